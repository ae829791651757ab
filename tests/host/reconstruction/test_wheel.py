"""What is installed from the wheel: the libraries as they were built, with no compiler in sight."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from gellight.lab.core_board import build as core_board
from gellight.reconstruction.native import build, library
from tests.helpers.places import CHECKOUT

pytestmark = pytest.mark.nightly

COMPUTED_BY = """
import logging
logging.basicConfig()
from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
import gellight
print(gellight.__file__)
print(Reconstructor(load_bundle("synthetic")).status()["computed_by"])
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("wheel")
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", place], cwd=CHECKOUT, check=True)
    return next(place.glob("*.whl"))


def test_one_wheel_serves_every_platform_and_holds_each_library_once(wheel: Path) -> None:
    assert wheel.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        files = {name: archive.read(name) for name in archive.namelist() if name.endswith(".so")}
        packed = sum(archive.getinfo(name).compress_size for name in files)
    built = [build.library_file(name) for name in build.TARGETS]
    built += [core_board.library_file(name) for name in core_board.TARGETS]
    assert files == {path.relative_to(CHECKOUT / "host").as_posix(): path.read_bytes() for path in built}
    assert packed < 500_000, "bytes; more would be worth a wheel for each platform"


@pytest.mark.skipif(not library.fitting(), reason="no library is built for this machine")
def test_the_installed_library_is_loaded_without_a_compiler(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    block = tmp_path / "ziglang"
    block.mkdir()
    (block / "__init__.py").write_text("raise ImportError('no compiler here')")
    done = subprocess.run(
        [sys.executable, "-c", COMPUTED_BY],
        env={"PYTHONPATH": str(tmp_path), "PATH": "/nowhere"},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    where, computed_by = done.stdout.splitlines()
    assert where.startswith(str(tmp_path)), "the wheel's files run, not the checkout's"
    assert computed_by == f"C, {library.fitting()[0]}", done.stderr
