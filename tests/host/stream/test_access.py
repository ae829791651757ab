"""The settings of zenoh that the documents show: who has no certificate reads nothing, and a reader may only read."""

import itertools
import re
from pathlib import Path

import pytest

from gellight.base.errors import StreamError
from gellight.base.settings import load_settings
from gellight.cli.one_sensor import opened
from gellight.stream.network import zenoh_settings
from gellight.stream.publisher import Publisher
from gellight.stream.subscription import subscribe
from tests.helpers.children import run
from tests.helpers.places import CHECKOUT
from tests.helpers.streamed import bump_daemon
from tests.helpers.weighed import HeavyFrames

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


def test_a_file_that_is_no_configuration_is_refused(tmp_path: Path) -> None:
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


def test_a_file_that_is_no_configuration_is_told_before_a_sensor_is_opened(tmp_path: Path) -> None:
    given = {"sensor.url": "v4l2:///dev/nothing-here", "stream.zenoh_config": str(tmp_path / "none.json5")}
    with pytest.raises(StreamError, match=r"none\.json5 cannot be read"):
        opened(load_settings(given)).__enter__()
