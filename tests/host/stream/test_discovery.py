"""Daemons of other computers are found by multicast: here a daemon that this user's list of daemons does not know."""

import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from gellight.base.errors import StreamError
from gellight.stream import network, subscription
from gellight.stream.publisher import Publisher
from gellight.stream.subscription import subscribe
from tests.helpers.streamed import bump_daemon

GROUP = "224.0.0.224"


def multicast_works() -> bool:
    """Whether a datagram to a group comes back on this machine; zenoh is not asked."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as reader,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as writer,
    ):
        reader.bind(("", 0))
        reader.settimeout(2)
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
    """Start a daemon with --lan whose file nobody finds; only what was started here answers."""
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
    with pytest.raises(StreamError, match=r"no daemon publishes middle on this computer or, with --lan, on the local"):
        subscribe("middle")


def test_when_every_port_is_taken_the_remedy_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(network, "LAN_PORTS", 1)
    with socket.create_server(("", 0)) as taken:
        monkeypatch.setattr(network, "LAN_PORT", taken.getsockname()[1])
        with pytest.raises(StreamError, match=r"are all in use: .*without --lan"):
            network.free_lan_port()


@pytest.mark.parametrize(
    ("endpoint", "own"),
    [("tcp/127.0.0.1:7447", True), ("tcp/[::1]:7447", True), ("tcp/192.0.2.2:7447", False), ("tcp/[fd00::2]:1", False)],
)
def test_addresses_of_this_computer_alone_are_told_from_others(endpoint: str, own: bool) -> None:
    assert network._is_loopback(endpoint) == own
