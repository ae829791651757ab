"""The shipped libraries: of aarch64, run by QEMU on any machine, against NumPy; and in the wheel as they were built."""

import subprocess
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from firmware.tools.libraries import BOARDS, FRAME_PATHS
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path import pipeline
from gellight.frames.frames import CameraFrame
from gellight.lab.core_board import core
from gellight.reconstruction.native import judge, library
from tests.benchmarks.frame_times import scenes
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.native_forms import agree, both
from tests.helpers.other_processor import OtherProcessor, build_server
from tests.helpers.places import CHECKOUT

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_server(tmp_path_factory.mktemp("server"))


@pytest.fixture
def aarch64(server: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[OtherProcessor]:
    with OtherProcessor(library.library_file("aarch64"), server) as emulated:
        monkeypatch.setattr(pipeline, "fitting_library", lambda: ("aarch64", emulated))
        yield emulated


def compare(bundle: Bundle, seed: int = 0, **options: object) -> None:
    native, pixels = both(bundle, **options)
    frame = CameraFrame(image=judge.made_up_image(bundle, seed), time_s=0.0, sequence=0)
    agree(native.reconstruct(frame), pixels.reconstruct(frame))
    assert native.status()["computed_by"] == "C, aarch64"


def test_the_shipped_network_gives_the_same_there(aarch64: OtherProcessor) -> None:
    """On a frame with gel at rest, and on a steep one: some of its pixels go through the network one by one.

    That one casts shadows, too.
    """
    bundle = load_bundle("synthetic")
    compare(bundle)
    native, pixels = both(bundle)
    frame = CameraFrame(image=scenes(bundle)["all touched, steep"], time_s=0.0, sequence=0)
    agree(native.reconstruct(frame), pixels.reconstruct(frame))
    # Without the light of depth it is first asked whether there can be shadows.
    as_it_looks = bundle.manifest.model_copy(update={"light_by_depth": False})
    compare(replace(bundle, manifest=as_it_looks))
    assert aarch64.called == set(library.SIGNATURES)


@pytest.mark.parametrize("smoothing_px", [0, 2, 7])
@pytest.mark.parametrize("shape", [(32, 32), (60, 84), (120, 160)])
def test_images_of_other_sizes(
    aarch64: OtherProcessor, tmp_path: Path, shape: tuple[int, int], smoothing_px: int
) -> None:
    compare(linear_bundle(tmp_path / "b", shape), seed=1, smoothing_px=smoothing_px)


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
    built = [library.library_file(name) for name in FRAME_PATHS]
    built += [core.library_file(name) for name in BOARDS]
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
