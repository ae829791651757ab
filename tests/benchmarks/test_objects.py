"""Errors on balls as printed; of the ten objects, what `--rezero` changes of a bundle and what it leaves."""

from pathlib import Path

import numpy as np
import pytest

from gellight.bundle.bundle import LedSetting, write_bundle
from tests.benchmarks import presses
from tests.benchmarks.objects import rezeroed
from tests.helpers.linear_sensor import BUNDLE_SHAPE, linear_network, reference_image
from tests.helpers.scripted_camera import flat_camera


def test_a_bundle_that_is_rezeroed_keeps_all_but_its_reference_image(tmp_path: Path) -> None:
    bundle = write_bundle(
        tmp_path / "old",
        sensor="one",
        reference=reference_image(BUNDLE_SHAPE) + 7,
        reference_frames=8,
        noise_grey=1.0,
        pixel_size_mm=(0.05, 0.06),
        network=linear_network(),
        network_name="other.onnx",
        metrics={"ball_radius_mm": 4.0},
        bulge=0.7,
        follow_light=True,
        led=tuple(LedSetting.model_validate({"colour": "R", "rgb": (255, 0, 0)}) for _ in range(12)),
        camera={"exposure_us": 8000.0},
        extra_files={"lens.json": b"{}", "lights.json": b"{}"},
    )
    new = rezeroed(bundle, flat_camera())
    assert np.array_equal(new.reference, np.rint(reference_image(BUNDLE_SHAPE)))
    changed = {"files", "reference_frames"}
    assert new.manifest.model_dump(exclude=changed) == bundle.manifest.model_dump(exclude=changed)
    assert {name for name in bundle.files if bundle.files[name] != new.files.get(name)} == {"reference.png"}
    assert set(new.files) == set(bundle.files)


def test_presses_are_measured_at_four_depths(capsys: pytest.CaptureFixture[str]) -> None:
    presses.main(presses=1)
    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    rows = {name: [float(word) for word in words] for name, *words in printed}
    assert rows["press_depth_mm"] == [0.5, 1, 1.5, 2]
    in_contact = rows["contact_normal_mae_deg"]
    assert all(0 < error < 1 for error in in_contact)
    assert in_contact[0] < in_contact[3], "the deeper, the steeper"
