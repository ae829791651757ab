"""Daemons of other computers: found by multicast where this user's list does not know them; certificates and access."""

import itertools
import re
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from gellight.base.errors import StreamError
from gellight.base.settings import load_settings
from gellight.cli.one_sensor import opened
from gellight.stream import network, subscription
from gellight.stream.network import zenoh_settings
from gellight.stream.publisher import Publisher
from gellight.stream.subscription import subscribe
from tests.helpers.children import run
from tests.helpers.places import CHECKOUT
from tests.helpers.streamed import bump_daemon
from tests.helpers.weighed import HeavyFrames

GROUP = "224.0.0.224"


def multicast_works() -> bool:
    """Whether a datagram to a group comes back on this machine; zenoh is not asked."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as reader,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as writer,
    ):
        reader.bind(("", 0))
        reader.settimeout(10)
        try:
            member = struct.pack("4s4s", socket.inet_aton(GROUP), socket.inet_aton("0.0.0.0"))
            reader.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
            writer.sendto(b"x", (GROUP, reader.getsockname()[1]))
            return reader.recv(1) == b"x"
        except OSError:
            return False


Start = Callable[[str], Publisher]


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    """Start a daemon with stream.lan whose file nobody finds; only what was started here answers."""
    if not multicast_works():
        pytest.skip("this machine has no network card that takes multicast")
    ports: list[int] = []
    scouted = network.found_by_multicast

    def ours() -> list[str]:
        return [endpoint for endpoint in scouted() if endpoint.rsplit(":", 1)[1] in map(str, ports)]

    monkeypatch.setattr(subscription, "found_by_multicast", ours)
    with ExitStack() as stack:

        def started(name: str) -> Publisher:
            monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / f"of-{name}"))
            (tmp_path / f"of-{name}").mkdir()
            daemon, _ = bump_daemon()
            stack.enter_context(daemon)
            publisher = stack.enter_context(Publisher(daemon, name=name, lan=True))
            ports.append(publisher.lan_port)
            monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "of-nobody"))
            return publisher

        yield started


def test_auto_finds_the_only_daemon_of_the_network(start: Start) -> None:
    start("far away")
    with subscribe("auto") as frames:
        assert frames.name == "far away"
        assert frames.next_frame().depth_mm.max() > 0.4


def test_a_name_is_looked_for_on_the_network_too(start: Start) -> None:
    left, right = start("left"), start("right")
    assert left.lan_port != right.lan_port
    with subscribe("right") as frames:
        assert frames.name == "right"
        assert frames.next_frame().depth_mm.max() > 0.4
    with pytest.raises(
        StreamError, match=r"several daemons publish on the local network: give one of zenoh://.*left"
    ) as told:
        subscribe("auto")
    url = str(told.value).split("give one of ")[1].split(", ")[0]
    with subscribe(url) as frames:
        assert frames.name in ("left", "right")
    with pytest.raises(StreamError, match=r"no daemon publishes middle here or, with stream.lan, on the local"):
        subscribe("middle")


def test_when_every_port_is_taken_the_remedy_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(network, "LAN_PORTS", 1)
    with socket.create_server(("", 0)) as taken:
        monkeypatch.setattr(network, "LAN_PORT", taken.getsockname()[1])
        with pytest.raises(StreamError, match=r"are all in use: .*without stream.lan"):
            network.free_lan_port()


@pytest.mark.parametrize(
    ("endpoint", "own"),
    [("tcp/127.0.0.1:7447", True), ("tcp/[::1]:7447", True), ("tcp/192.0.2.2:7447", False), ("tcp/[fd00::2]:1", False)],
)
def test_addresses_of_this_computer_alone_are_told_from_others(endpoint: str, own: bool) -> None:
    assert network.is_loopback(endpoint) == own


# ---- settings of zenoh: who has no certificate reads nothing, and a reader may only read ----


PORT = 17448
EC = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with certificates, and with the settings of the documents that name them."""
    folder = tmp_path_factory.mktemp("tls")
    made = {"cwd": folder, "check": True}
    run(["openssl", "req", "-x509", *EC, "-keyout", "ca.key", "-out", "ca.pem", "-subj", "/CN=test"], **made)
    (folder / "names").write_text("subjectAltName=DNS:localhost")
    for name in ("daemon", "reader", "stranger"):
        run(["openssl", "req", *EC, "-keyout", f"{name}.key", "-out", f"{name}.csr", "-subj", f"/CN={name}"], **made)
        run(["openssl", "x509", "-req", "-in", f"{name}.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial",
             "-days", "2", "-extfile", "names", "-out", f"{name}.pem"], **made)  # fmt: skip
    daemon, reader = ((CHECKOUT / f"docs/examples/{name}.json5").read_text() for name in ("daemon", "reader"))
    daemon = daemon.replace("tls/0.0.0.0:7448", f"tls/127.0.0.1:{PORT}")
    for name, content in {"daemon": daemon, "reader": reader, "stranger": reader.replace("reader", "stranger")}.items():
        placed = re.sub(r'"(\w+\.(pem|key))"', rf'"{folder}/\1"', content)
        (folder / f"{name}.json5").write_text(placed)
    return folder


def test_a_reader_with_a_certificate_may_read_and_nothing_else(settings: Path) -> None:
    url, (daemon, _) = f"zenoh+tls://localhost:{PORT}/finger", bump_daemon(measures=HeavyFrames())
    with daemon, Publisher(daemon, name="finger", config=settings / "daemon.json5"):
        with subscribe(url, config=settings / "reader.json5") as frames:
            assert frames.next_frame().contact.indentation_mm > 0.4
            with pytest.raises(StreamError, match="does not answer"):
                frames.status()
        with subscribe(url, config=settings / "reader.json5", maps=["confidence"]) as frames:
            assert next(frame for frame in itertools.islice(frames, 200) if "confidence" in vars(frame))
        with pytest.raises(StreamError, match="no one daemon of finger"):
            subscribe(url, config=settings / "stranger.json5")
        with pytest.raises(StreamError, match="no connection"):
            subscribe(url)
        with subscribe("finger") as frames:
            assert frames.status()["mode"] == "formula", "this computer may do all"


def test_a_file_that_is_no_configuration_is_refused_before_a_sensor_is_opened(tmp_path: Path) -> None:
    """With the place in the file, and without one in zenoh's own source."""
    (tmp_path / "wrong.json5").write_text("{ listen: ")
    daemon, _ = bump_daemon()
    with (
        daemon,
        pytest.raises(StreamError, match=r"wrong\.json5 is no configuration of zenoh \(line 1, column 11\)"),
    ):
        Publisher(daemon, config=tmp_path / "wrong.json5").__enter__()
    for name, why in (("none.json5", "No such file or directory"), (".", "Is a directory")):
        with pytest.raises(StreamError, match=rf"cannot be read \({why}\): check the name$"):
            zenoh_settings(tmp_path / name)
    given = {"sensor.url": "v4l2:///dev/nothing-here", "stream.zenoh_config": str(tmp_path / "none.json5")}
    with pytest.raises(StreamError, match=r"none\.json5 cannot be read"):
        opened(load_settings(given)).__enter__()
