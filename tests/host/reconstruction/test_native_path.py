"""The C library against the NumPy form, on random frames of any size, and what is done where it does not fit."""

import shutil
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from firmware.tools import libraries
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path import pipeline
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.image_files import read_image
from gellight.reconstruction.native import judge, library
from gellight.reconstruction.native.native_path import NativePath
from tests.helpers.analytic_surfaces import gaussian
from tests.helpers.linear_sensor import bundle_of, linear_bundle, photograph, reference_image
from tests.helpers.native_forms import agree, both
from tests.helpers.places import real_picture

ROOT = Path(__file__).parents[3]
SYNTHETIC = load_bundle("synthetic")
BEST = next(iter(library.fitting()), None)
RUNNABLE = [pytest.param(name, marks=[pytest.mark.nightly] * (name != BEST)) for name in library.fitting()]
needs_a_library = pytest.mark.skipif(not RUNNABLE, reason="no library is built for this machine")


def choose(chosen: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pipeline, "fitting_library", lambda: (chosen, library.Library(library.library_file(chosen))))


@pytest.fixture(params=RUNNABLE)
def name(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each library that runs here, in turn, as the one that is chosen; by day the best one alone."""
    choose(request.param, monkeypatch)
    return str(request.param)


def frame_of(image: np.ndarray) -> CameraFrame:
    return CameraFrame(image=image, time_s=0.0, sequence=0)


def same(bundle: Bundle, image: np.ndarray, **options: object) -> Reconstructor:
    """Compute a frame in both forms, which have to agree; return the native one."""
    native, pixels = both(bundle, **options)
    agree(native.reconstruct(frame_of(image)), pixels.reconstruct(frame_of(image)))
    return native


@needs_a_library
def test_no_library_computes_anything_else(monkeypatch: pytest.MonkeyPatch) -> None:
    for chosen in library.fitting():
        choose(chosen, monkeypatch)
        assert same(SYNTHETIC, judge.made_up_image(SYNTHETIC)).status()["computed_by"] == f"C, {chosen}"


@needs_a_library
@pytest.mark.parametrize(("seed", "smoothing_px"), [(0, 0), (1, 2), (2, 3), (0, 6)])
def test_every_library_computes_what_numpy_computes(name: str, seed: int, smoothing_px: int) -> None:
    same(SYNTHETIC, judge.made_up_image(SYNTHETIC, seed), smoothing_px=smoothing_px)


@needs_a_library
@given(
    height=st.integers(32, 130),
    width=st.integers(32, 130),
    place=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6)),
    sigma_px=st.floats(3, 30),
    slope=st.floats(0.05, 1.5),
    seed=st.integers(0, 99),
)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_press_anywhere_in_an_image_of_any_size(
    tmp_path_factory: pytest.TempPathFactory,
    height: int,
    width: int,
    place: tuple[float, float],
    sigma_px: float,
    slope: float,
    seed: int,
) -> None:
    shape = (height, width)
    bundle = linear_bundle(tmp_path_factory.mktemp("any") / "b", shape)
    bump = gaussian(shape, sigma_px, (place[0] * width, place[1] * height), height=slope * sigma_px)
    same(bundle, photograph(bump.gradient_map, noise_grey=1.0, rng=np.random.default_rng(seed)).image)


@needs_a_library
def test_the_mask_goes_by_the_gel_at_rest(name: str) -> None:
    """Limits on both means are those of the NumPy form, which no multiple of one number gives."""
    bundle = replace(SYNTHETIC, manifest=SYNTHETIC.manifest.model_copy(update={"rest_grey": 1.7}))
    image, (noisy, _) = judge.made_up_image(SYNTHETIC, 1), both(SYNTHETIC)
    native = same(bundle, image)
    noisy.reconstruct(frame_of(image))
    assert 0 < native.network_rows.cells < noisy.network_rows.cells


@needs_a_library
def test_light_that_drifts_is_followed(name: str, tmp_path: Path) -> None:
    bundle = bundle_of(tmp_path / "b", reference_image((120, 160)), follow_light=True)
    frame = photograph(gaussian((120, 160), 9, (5, 5), height=9).gradient_map, noise_grey=1.0)
    drifted = frame_of(np.clip(frame.image + np.array([7, 3, 11]), 0, 255).astype(np.uint8))
    native, pixels = both(bundle)
    found, right = native.reconstruct(drifted), pixels.reconstruct(drifted)
    agree(found, right)
    assert np.abs(found.difference[:20].mean(axis=(0, 1))).max() < 1


@needs_a_library
def test_a_view_that_is_touched_all_over(name: str, tmp_path: Path) -> None:
    """Then nothing is at rest, and the height comes from the bulge."""
    shape = (120, 160)
    y, x = np.indices(shape)
    slopes = np.stack([0.4 * np.cos(x / 9), 0.4 * np.sin(y / 11)], axis=2)
    native, pixels = both(linear_bundle(tmp_path / "b", shape))
    frame = photograph(slopes, noise_grey=1.0)
    assert pixels.network.touched(pixels.reconstruct(frame).difference).all()
    agree(native.reconstruct(frame), pixels.reconstruct(frame))


@needs_a_library
def test_a_picture_that_is_not_contiguous(name: str) -> None:
    image = judge.made_up_image(SYNTHETIC)
    native, _ = both(SYNTHETIC)
    turned = frame_of(np.ascontiguousarray(image[::-1])[::-1])
    right = native.reconstruct(frame_of(image))
    np.testing.assert_array_equal(native.reconstruct(turned).depth_mm, right.depth_mm)


@needs_a_library
def test_a_network_that_answers_nan_is_an_error_and_not_a_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    native, _ = both(SYNTHETIC)
    path = native._path
    nan = lambda rows: (rows[:, :2] * np.nan, np.zeros((len(rows), 6)))  # noqa: E731
    monkeypatch.setattr(path._answers, "slopes_and_jacobian", nan)
    with pytest.raises(ValueError, match="NaN or infinite"):
        native.reconstruct(frame_of(judge.made_up_image(SYNTHETIC)))


@needs_a_library
@pytest.mark.parametrize(
    ("name", "untouched", "pixel_mm"),
    [
        ("three_lights/press.png", "untouched.png", 0.0136138),
        *(
            pytest.param(
                f"gelsight_mini_ball/{number}.png", "background.png", 0.05107,
                marks=pytest.mark.real_images("gelsight_mini_ball"),
            )
            for number in ("0001", "0025", "0042")
        ),
    ],
)  # fmt: skip
def test_a_press_on_a_real_sensor(tmp_path: Path, name: str, untouched: str, pixel_mm: float) -> None:
    """Its noise, its compression and its light; the network is another sensor's, which the comparison does not mind."""
    paths = (real_picture(name), real_picture(name).with_name(untouched))
    image, background = (read_image(path) for path in paths)
    reference, pixel = background.astype(np.float32), (pixel_mm, pixel_mm)
    same(bundle_of(tmp_path / "b", reference, pixel_size_mm=pixel, network=SYNTHETIC.network), image)


def numpy_because(bundle: Bundle, caplog: pytest.LogCaptureFixture) -> str:
    caplog.clear()
    reconstructor = Reconstructor(bundle)
    assert reconstructor.status()["computed_by"] == "NumPy"
    assert len(caplog.messages) == 1
    return caplog.messages[0]


def test_where_no_library_fits_numpy_computes_and_the_log_says_so(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(library.sys, "platform", "darwin")
    message = numpy_because(SYNTHETIC, caplog)
    assert message.startswith("frames are computed by NumPy, which takes longer: no library is built for darwin on ")


@pytest.mark.parametrize("shape", [(31, 40), (40, 31)])
def test_small_images_are_left_to_numpy(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, shape: tuple[int, int]
) -> None:
    assert "too small" in numpy_because(linear_bundle(tmp_path / "b", shape), caplog)


@pytest.mark.parametrize(
    ("off_deg", "off_mm", "refused"),
    [
        ((0.0099, 0.499), (0.99e-4, 0.0199), None),
        ((0.0101, 0.0), (0.0, 0.0), "every pixel"),
        ((0.0, 0.0), (1.01e-4, 0.0), "every pixel"),
        ((0.0, 0.501), (0.0, 0.0), "cells"),
        ((0.0, 0.0), (0.0, 0.0201), "cells"),
        ((np.nan, 0.0), (0.0, 0.0), "every pixel"),
        ((0.0, 0.0), (0.0, np.nan), "cells"),
    ],
)
def test_a_path_is_refused_that_differs_in_the_mean(
    off_deg: tuple[float, float], off_mm: tuple[float, float], refused: str | None
) -> None:
    """Asked at every pixel, then at cells."""

    def frame(degrees: float = 0.0, depth_mm: float = 0.0) -> Any:
        normal = np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])
        return SimpleNamespace(normal_map=np.tile(normal, (4, 6, 1)), depth_mm=np.full((4, 6), depth_mm))

    class Path:
        limits = "at cells"

        def reconstruct(self, _: CameraFrame) -> Any:
            cells = self.limits == "at cells"
            return frame(off_deg[cells], off_mm[cells])

    path: Any = Path()
    right: Any = SimpleNamespace(reconstruct=lambda _: frame())
    with pytest.raises(library.NativePathError, match=f"asked at {refused},") if refused else nullcontext():
        judge.refuse_disagreement(path, right, SYNTHETIC)
    assert refused or path.limits == "at cells"


@pytest.mark.parametrize(
    ("depths", "apart"), [((9.99, 10.01), 0.01), ((10.01, 91.0), 0.0), ((-10.01, -91.0), 0.0), ((0.0, np.nan), np.nan)]
)
def test_depths_that_no_gel_has_differ_in_nothing(depths: tuple[float, float], apart: float) -> None:
    """Two presses of a unit like another taught slopes along the line of sight: NumPy's 91.10 mm were 91.02 in C."""
    frames: list[Any] = [
        SimpleNamespace(normal_map=np.tile([0.0, 0.0, 1.0], (4, 6, 1)), depth_mm=np.full((4, 6), depth_mm))
        for depth_mm in depths
    ]
    assert judge.differences(*frames) == pytest.approx((0.0, apart), nan_ok=True)


@needs_a_library
def test_a_damaged_library_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """To load the half of a library would end the process."""
    whole = library.library_file(library.fitting()[0])
    broken = tmp_path / whole.name
    monkeypatch.setattr(library, "library_file", lambda name: broken)
    assert "No such file" in numpy_because(SYNTHETIC, caplog)
    broken.write_bytes(whole.read_bytes()[:5000])
    assert f"{broken} is damaged (SHA-256 " in numpy_because(SYNTHETIC, caplog)


def test_a_file_that_is_no_library_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.so").write_text("no library")
    with pytest.raises(library.NativePathError, match=r"text\.so cannot be loaded \(.*too short"):
        library.Library(tmp_path / "text.so")


@needs_a_library
@pytest.mark.parametrize("wrong", ["slope", "nan"])
def test_a_library_that_answers_otherwise_is_refused(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, wrong: str
) -> None:
    right = NativePath.reconstruct

    def reconstruct(self: NativePath, frame: CameraFrame) -> TactileFrame:
        found = right(self, frame)
        found.normal_map[..., 0] += 0.01 if wrong == "slope" else np.nan
        return found

    monkeypatch.setattr(NativePath, "reconstruct", reconstruct)
    assert "answers otherwise than NumPy on this machine" in numpy_because(SYNTHETIC, caplog)


@pytest.mark.nightly
def test_the_committed_libraries_are_built_from_the_sources() -> None:
    """The same bytes from the same compiler, on any machine."""
    for target in libraries.FRAME_PATHS:
        committed = library.library_file(target).read_bytes()
        assert libraries.frame_path(target) == committed, f"{target}: build the libraries again"


def test_the_libraries_need_nothing_but_two_functions_of_c() -> None:
    for target in libraries.FRAME_PATHS:
        library.check_whole(library.library_file(target))
        content = library.library_file(target).read_bytes()
        assert content.startswith(b"\x7fELF")
        assert b"libc" not in content


SANITIZED = """
import sys
from pathlib import Path
import numpy as np
from gellight.bundle.bundle import load_bundle
from gellight.frames.frames import CameraFrame
from tests.benchmarks.frame_times import scenes
from gellight.frame_path import pipeline
from gellight.reconstruction.native import judge, library
sys.path.insert(0, {root!r})
from tests.helpers.linear_sensor import linear_bundle
loaded = library.Library(Path({path!r}))
pipeline.fitting_library = lambda: ("sanitized", loaded)
for number, shape in enumerate(((32, 32), (33, 47), (50, 35), (61, 83), (64, 96), (120, 161))):
    bundle = linear_bundle(Path({folder!r}) / str(number), shape)
    for smoothing_px in (0, 2, 7):
        path = pipeline.Reconstructor(bundle, smoothing_px=smoothing_px)
        assert path.status()["computed_by"] == "C, sanitized", path.status()
        for seed in range(3):
            path.reconstruct(CameraFrame(image=judge.made_up_image(bundle, seed), time_s=0.0, sequence=0))
print("clean")
"""


def sanitized(tmp_path: Path, kind: str) -> Path:
    out = tmp_path / f"{kind}.so"
    of_frames = libraries.FLAGS
    flags = [*of_frames[:1], "-O1", "-g", *of_frames[2:], f"-fsanitize={kind}", "-fno-sanitize-recover=all"]
    subprocess.run(
        ["gcc", *flags, "-fPIC", "-shared", *libraries.sources(), "-o", str(out)], cwd=library.FOLDER, check=True
    )
    return out


def run_sanitized(tmp_path: Path, path: Path, **environment: str) -> None:
    script = SANITIZED.format(root=str(ROOT), path=str(path), folder=str(tmp_path / path.stem))
    paths = f"{ROOT / 'host'}:{ROOT / 'models'}:{ROOT}"
    done = subprocess.run(
        [sys.executable, "-c", script], env={"PYTHONPATH": paths, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.strip().endswith("clean")


@pytest.mark.nightly
@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is missing")
def test_nothing_undefined_happens_and_no_memory_is_touched_that_was_not_given(tmp_path: Path) -> None:
    run_sanitized(tmp_path, sanitized(tmp_path, "undefined"))
    # With the C++ library first, so that the sanitizer finds the exceptions that OpenCV throws and catches.
    libraries = [
        subprocess.run(["gcc", f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout.strip()
        for name in ("libasan.so", "libstdc++.so.6")
    ]
    path = sanitized(tmp_path, "address")
    run_sanitized(tmp_path, path, LD_PRELOAD=" ".join(libraries), ASAN_OPTIONS="detect_leaks=0")
