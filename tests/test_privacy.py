"""Nothing that a user starts looks a name up, sends beyond this computer, or leaves in HOME what is not GelLight's.

Each program runs with a library before all others that writes down whom it asks and where it sends, its children too.
"""

import ipaddress
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.helpers.children import GELLIGHT, run
from tests.helpers.doc_examples import examples
from tests.helpers.places import CHECKOUT

PYTHON = (sys.executable, "-c")
IMPORTS = "import cv2, foxglove, gymnasium, h5py, mcap, mcubes, mujoco, pyarrow, serial, usb.core, x3pio, zenoh"
PATIENT = "import gellight\ngellight.connect.__kwdefaults__['patience_s'] = 180\n"
"""processors are shared"""
PROGRAMS = {
    "readme": (*PYTHON, PATIENT + examples("README.md")[0]),
    "run": (*GELLIGHT, *["run", "--sensor", "sim://", "--frames", "3", "--set", "stream.name=quiet"]),
    "packages": (*PYTHON, IMPORTS),
    "training": (*PYTHON, "import gelnet.export"),
}


@pytest.fixture(scope="session")
def recorder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    library = tmp_path_factory.mktemp("recorder") / "record_calls.so"
    source = CHECKOUT / "tests/helpers/record_calls.c"
    flags = ["-shared", "-fPIC", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["cc", *flags, source, "-o", library, "-ldl"], check=True)
    return library


Watched = Callable[[tuple[str, ...]], tuple[set[str], set[str]]]


@pytest.fixture
def watched(recorder: Path, tmp_path: Path) -> Watched:
    """Run a program in a HOME of its own; return what it asked or sent beyond this computer, and what HOME holds."""
    home = tmp_path / "home"
    home.mkdir()
    own = {"HOME": str(home), "LD_PRELOAD": str(recorder), "RECORD_CALLS": str(tmp_path / "calls")}
    # where CI or one of a dozen other names is set, ONNX Runtime stays silent
    kept = {name: os.environ[name] for name in ("PATH", "PYTHONPATH", "OPENBLAS_CORETYPE") if name in os.environ}

    def watch(command: tuple[str, ...]) -> tuple[set[str], set[str]]:
        run(command, cwd=tmp_path, env={**kept, **own}, check=True)
        calls = (tmp_path / "calls").read_text().splitlines() if (tmp_path / "calls").exists() else []
        left = {path.relative_to(home).as_posix() for path in home.rglob("*") if not path.is_dir()}
        return {call for call in calls if not _stays_here(call)}, {path for path in left if "gellight" not in path}

    return watch


def _stays_here(call: str) -> bool:
    """Whether it is about this computer, or says to whoever listens nearby that a sensor is here (multicast)."""
    kind, _, whom = call.partition(" ")
    if kind == "name" and whom in ("", "localhost", os.uname().nodename):
        return True
    try:
        address = ipaddress.ip_address(whom)
    except ValueError:
        return False
    return address.is_loopback or address.is_multicast or address.is_unspecified


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_asks_nobody_and_leaves_nothing_in_home(name: str, watched: Watched) -> None:
    assert watched(PROGRAMS[name]) == (set(), set())


@pytest.mark.parametrize(
    ("code", "noticed"),
    [
        ("import socket\ntry: socket.getaddrinfo('events.example', 443)\nexcept OSError: pass", "name events.example"),
        ("import socket\nsocket.socket(type=socket.SOCK_DGRAM).sendto(b'', ('192.0.2.1', 9))", "send 192.0.2.1"),
        ("import pathlib\n(pathlib.Path.home() / 'deviceid').write_text('')", "deviceid"),
        ("import os\nos.environ['ORT_DISABLE_TELEMETRY'] = '0'\nimport onnxruntime", ".onnxruntime/deviceid"),
    ],
    ids=["name", "address", "file", "the telemetry itself"],
)
def test_a_program_that_does_is_noticed(code: str, noticed: str, watched: Watched) -> None:
    assert noticed in "\n".join(set.union(*watched((*PYTHON, code))))
