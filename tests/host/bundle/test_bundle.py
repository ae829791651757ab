"""Bundles: what is written is what is loaded, and nothing that is damaged is."""

import errno
import hashlib
import os
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle, LedSetting, load_bundle, packed_bundle, save_bundle, write_bundle
from tests.helpers.linear_sensor import bundle_of, linear_bundle, linear_network, reference_image
from tests.helpers.sensor_bench import lit_bundle

SHAPE = (24, 32)


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    linear_bundle(tmp_path / "bundle", SHAPE)
    return tmp_path / "bundle"


def rewrite_manifest(bundle: Path, old: str, new: str) -> None:
    path = bundle / "manifest.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_everything_written_comes_back(tmp_path: Path) -> None:
    led = tuple(LedSetting(colour=c, rgb=(40, 30, 20)) for c in "RRRRGGGGBBBB")
    rows = np.arange(14, dtype=np.float32).reshape(2, 7)
    written = write_bundle(
        tmp_path / "deep" / "bundle",
        sensor="GL-007",
        reference=reference_image(SHAPE),
        reference_frames=64,
        noise_grey=1.25,
        pixel_size_mm=(0.0588, 0.059),
        network=linear_network(),
        network_name="mine.onnx",
        metrics={"mean_deg": 1.5},
        presses={"rows": rows},
        led=led,
        camera={"exposure_us": 8000, "auto_white_balance": False},
        extra_files={"provenance.json": b"{}"},
    )
    for bundle in (written, load_bundle(tmp_path / "deep" / "bundle")):
        manifest = bundle.manifest
        assert (manifest.sensor, manifest.reference_frames, manifest.noise_grey) == ("GL-007", 64, 1.25)
        assert bundle.image_shape == SHAPE
        assert bundle.pixel_size_mm == (0.0588, 0.059)
        assert bundle.network == linear_network()
        assert bundle.metrics == {"mean_deg": 1.5}
        assert manifest.led == led
        assert manifest.camera == {"exposure_us": 8000, "auto_white_balance": False}
        assert bundle.files["provenance.json"] == b"{}"
        np.testing.assert_array_equal(bundle.presses()["rows"], rows)


def test_the_reference_keeps_its_fraction_and_its_channel_order(bundle: Path) -> None:
    reference = load_bundle(bundle).reference
    assert reference.dtype == np.float32
    assert np.abs(reference - reference_image(SHAPE)).max() <= 1 / 512
    stored = cv2.imread(str(bundle / "reference.png"), cv2.IMREAD_UNCHANGED)
    assert stored.dtype == np.uint16
    assert np.abs(stored[..., 2] / 256 - reference_image(SHAPE)[..., 0]).max() <= 1 / 512
    with pytest.raises(ValueError, match="read-only"):
        reference[0, 0, 0] = 1


def packed(bundle: Bundle, folder: Path) -> Path:
    """Write a bundle as one file."""
    (folder / "sensor.gelcal").write_bytes(packed_bundle(bundle))
    return folder / "sensor.gelcal"


def test_a_bundle_is_the_same_wherever_it_lies(bundle: Path, tmp_path: Path) -> None:
    folder = load_bundle(bundle)
    loaded = load_bundle(packed(folder, tmp_path))
    assert (loaded.manifest, loaded.files) == (folder.manifest, folder.files)
    copied = save_bundle(folder, tmp_path / "copy")
    rewrite_manifest(bundle, "bulge = 1.71\n", "")
    assert len(bytes.fromhex(folder.identity)) == 8
    assert {loaded.identity, copied.identity, load_bundle(bundle).identity} == {folder.identity}, (
        "a field that an older GelLight did not write changes nothing"
    )
    other = linear_bundle(tmp_path / "other", SHAPE, pixel_size_mm=(0.05, 0.051))
    assert other.identity != folder.identity


def test_a_bundle_takes_another_reference_image_in_memory_only(bundle: Path) -> None:
    folder = load_bundle(bundle)
    brighter = folder.with_reference(folder.reference + 2.25, frames=50)
    assert np.abs(brighter.reference - folder.reference - 2.25).max() <= 1 / 256
    assert brighter.manifest.reference_frames == 50
    assert (brighter.network, brighter.source) == (folder.network, folder.source)
    assert load_bundle(bundle).identity == folder.identity != brighter.identity
    with pytest.raises(ValueError, match="shape"):
        folder.with_reference(np.zeros((4, 4, 3)), frames=1)
    with pytest.raises(BundleError, match="0 to 255"):
        folder.with_reference(folder.reference + 500, frames=1)


def test_an_existing_bundle_is_replaced_only_when_told(bundle: Path) -> None:
    before = (bundle / "manifest.toml").read_bytes()
    with pytest.raises(BundleError, match="exists: choose another name or allow overwriting"):
        linear_bundle(bundle, (48, 64))
    assert (bundle / "manifest.toml").read_bytes() == before
    assert linear_bundle(bundle, (48, 64), overwrite=True).image_shape == (48, 64)
    assert [p.name for p in bundle.parent.iterdir()] == ["bundle"]


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_full_disk_leaves_what_was_there(bundle: Path, monkeypatch: pytest.MonkeyPatch, overwrite: bool) -> None:
    target = bundle if overwrite else bundle.parent / "other"
    before = sorted(str(p) for p in bundle.parent.rglob("*"))
    flush = os.fsync

    def full(handle: int) -> None:
        if Path(f"/proc/self/fd/{handle}").readlink().name == "network.onnx":
            os.ftruncate(handle, 10)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        flush(handle)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(BundleError, match=r"not written \(No space left on device\): free some space"):
        linear_bundle(target, SHAPE, overwrite=overwrite)
    assert sorted(str(p) for p in bundle.parent.rglob("*")) == before
    load_bundle(bundle)


def test_what_does_not_exist_is_named(tmp_path: Path, bundle: Path) -> None:
    with pytest.raises(BundleError, match=r"nowhere does not exist: give a folder, a \.gelcal file or 'synth"):
        load_bundle(tmp_path / "nowhere")
    with pytest.raises(BundleError, match=r"has no manifest\.toml"):
        load_bundle(tmp_path)
    with pytest.raises(BundleError, match=r"has no presses\.npz"):
        load_bundle(bundle).presses()


@pytest.mark.parametrize("name", ["reference.png", "network.onnx", "metrics.json"])
def test_a_changed_or_missing_file_is_named(bundle: Path, name: str) -> None:
    old = hashlib.sha256((bundle / name).read_bytes()).hexdigest()
    with (bundle / name).open("ab") as stream:
        stream.write(b"!")
    new = hashlib.sha256((bundle / name).read_bytes()).hexdigest()
    with pytest.raises(BundleError, match=f"{name} was changed .*{new[:12]}….*{old[:12]}….*restore the bundle"):
        load_bundle(bundle)
    (bundle / name).unlink()
    with pytest.raises(BundleError, match=f"has no {name}.*calibrate the sensor again or restore"):
        load_bundle(bundle)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("schema_version = 1", "schema_version = 2", "schema version 2, this GelLight reads up to 1: update GelLight"),
        ("schema_version = 1", "schema_version = 0", "schema_version"),
        ("noise_grey = 1.0", "noise_grey = nan", "noise_grey"),
        ("noise_grey = 1.0", "noise_grey = -1.0", "noise_grey"),
        ("    0.05,", "    nan,", "pixel_size_mm"),
        ("    0.05,", "    0.0,", "pixel_size_mm"),
        ("image_width_px = 32", "image_width_px = 33", r"reference.png is 32 x 24 px, the manifest says 33 x 24"),
        ("reference_frames = 64", "reference_frames = 64\nfocus = 3", "focus is unknown: leave it out"),
        ("reference_frames = 64", "reference_frames = ", "is not TOML"),
        ('sensor = "linear"', 'sensor = ""', "sensor"),
        ('"metrics.json"', '"../metrics.json"', "leaves the bundle"),
        ('network = "network.onnx"', 'network = "other.onnx"', "does not list other.onnx"),
        ("led = []", 'led = [{colour = "R", rgb = [1, 2, 3]}]', "led has 1 entries, a ring has 3 to 24"),
    ],
)
def test_a_wrong_manifest_is_refused(bundle: Path, old: str, new: str, message: str) -> None:
    rewrite_manifest(bundle, old, new)
    with pytest.raises(BundleError, match=message):
        load_bundle(bundle)


@pytest.mark.parametrize("name", ["../evil.onnx", "/evil.onnx", "sub/evil.onnx", "..\\evil.onnx", "c:evil.onnx"])
def test_an_archive_with_names_that_leave_it_is_refused(bundle: Path, tmp_path: Path, name: str) -> None:
    place = packed(load_bundle(bundle), tmp_path)
    with zipfile.ZipFile(place, "a") as archive:
        archive.writestr(name, b"evil")
    with pytest.raises(BundleError, match="leaves the bundle"):
        load_bundle(place)


@pytest.mark.parametrize("cut", [0, 10, 400])
def test_an_archive_that_is_cut_off_or_has_a_flipped_bit_is_refused(bundle: Path, tmp_path: Path, cut: int) -> None:
    place = packed(load_bundle(bundle), tmp_path)
    content = bytearray(place.read_bytes())
    place.write_bytes(content[:cut])
    with pytest.raises(BundleError, match=r"is not a whole \.gelcal file"):
        load_bundle(place)
    content[content.index(b"reference.png") + 200 + cut // 20] ^= 1
    place.write_bytes(content)
    with pytest.raises(BundleError, match=r"reference\.png"):
        load_bundle(place)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [*((value, "outside 0 to 255 grey levels") for value in (np.nan, -1.0, 256.0)), (None, "rows has NaN")],
)
def test_what_is_no_number_or_out_of_range_is_not_written(tmp_path: Path, wrong: float | None, said: str) -> None:
    reference, presses = reference_image(SHAPE), {"rows": np.array([np.nan if wrong is None else 1.0])}
    reference[3, 4, 1] = 100.0 if wrong is None else wrong
    with pytest.raises(BundleError, match=said):
        bundle_of(tmp_path / "bundle", reference, presses=presses)
    assert not list(tmp_path.iterdir())


def test_the_synthetic_bundle_is_found_beside_the_gelnet_package(
    tmp_path: Path, bundle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import importlib.util
    from importlib.machinery import ModuleSpec

    spec = ModuleSpec("gelnet", None, is_package=True)
    spec.submodule_search_locations.append(str(tmp_path))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: spec)
    with pytest.raises(BundleError, match=r"'synthetic' bundle is not installed .*: reinstall gellight"):
        load_bundle("synthetic")
    bundle.rename(tmp_path / "synthetic")
    assert load_bundle("synthetic").manifest.sensor == "linear"


def test_a_bundle_tells_the_controls_and_the_colours_of_its_sensor_and_not_how_the_camera_is_opened(
    bundle: Path, tmp_path: Path
) -> None:
    plain = load_bundle(bundle)
    assert plain.controls == {}
    assert plain.colours is None
    full = lit_bundle(tmp_path / "lit")
    assert full.controls == {"exposure_us": 8000.0, "white_balance_k": 5000.0}
    assert full.colours[[0, 4, 8]].tolist() == [[255, 0, 0], [0, 200, 0], [0, 0, 90]]
    rewrite_manifest(tmp_path / "lit", "exposure_us = 8000", 'exposure_us = "long"')
    with pytest.raises(BundleError, match=r"camera\.exposure_us = 'long' is no number: calibrate the sensor again"):
        _ = load_bundle(tmp_path / "lit").controls
