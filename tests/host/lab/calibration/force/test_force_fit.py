"""Forces: their record, the modulus, how honest the errors are, what is refused."""

from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.calibration.force.fit import chosen_layer, fit_force, left_out_share
from gellight.lab.calibration.force.indented import felt_in_images
from gellight.lab.calibration.force.record import ForceReadings
from gellight.lab.report.pictures import write_png
from gellight.opening import open_camera
from gellight.reconstruction.force_file import ForceRecord

FELT = np.array([0.0, 1.0, 2.0, 4.0, 8.0])


def read(tmp_path: Path, text: str) -> ForceReadings:
    (tmp_path / "forces.csv").write_text(text)
    return ForceReadings.read(tmp_path / "forces.csv")


def test_weights_beside_pictures_and_a_load_cell_are_read(tmp_path: Path) -> None:
    weights = read(tmp_path, "image,force_n\na.png,0.5\nb.png,1\n")
    assert (weights.images, weights.force_n.tolist()) == ((tmp_path / "a.png", tmp_path / "b.png"), [0.5, 1.0])
    cell = read(tmp_path, "unix_s,force_n\n1000.5,-0.01\n1000.6,2\n")
    assert (cell.images, cell.unix_s.tolist()) == ((), [1000.5, 1000.6])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("image,newton\na.png,1\n", "first line must be image,force_n or unix_s,force_n"),
        ("image,unix_s,force_n\na.png,1,1\n", "first line must be"),
        ("image,force_n\n", "has no forces"),
        ("image,force_n\na.png,heavy\n", "line 2: force_n is 'heavy'"),
        ("image,force_n\na.png,nan\n", "line 2: force_n is 'nan'"),
        ("image,force_n\na.png,1\n,2\n", "line 3: column image is empty"),
        ("image,force_n\na.png,1\nb.png,-0.5\n", r"a force is -0.5 N: set the load cell to zero"),
        ("image,force_n\na.png,-1\nb.png,0\n", r"the largest force is 0 N"),
        ("unix_s,force_n\n5,1\n5,2\n", "line 3: unix_s does not rise"),
        ("image,force_n,side_x_n,side_y_n\n1,1,1,1", "leave side_x_n, side_y_n out"),
    ],
)
def test_what_is_no_record_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        read(tmp_path, text)


def test_a_perfect_record_gives_its_modulus_and_the_error_of_other_shapes() -> None:
    fit = fit_force(0.2 * FELT, FELT, "record")
    assert fit.youngs_modulus_mpa == pytest.approx(0.2)
    assert fit.error_share == pytest.approx(0.05)
    assert (fit.readings, fit.lightest_n, fit.heaviest_n) == (4, pytest.approx(0.2), pytest.approx(1.6))


@pytest.mark.parametrize("seed", range(4))
def test_the_error_is_what_new_forces_are_off_by(seed: int) -> None:
    random = np.random.default_rng(seed)

    def record(count: int) -> tuple[np.ndarray, np.ndarray]:
        felt = random.uniform(0, 10, count)
        return np.maximum(0.2 * felt * random.normal(1, 0.1, count) + random.normal(0, 0.02, count), 0), felt

    fit = fit_force(*record(60), "record")
    force, felt = record(2000)
    off = (fit.youngs_modulus_mpa * felt - force) / np.hypot(fit.error_floor_n, fit.error_share * force)
    assert 0.75 < np.sqrt(np.mean(off**2)) < 1.25


def objects_of(share: float) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Three objects; the second layer tells all by one modulus, the first each by another, `share` apart."""
    force = np.tile([0.5, 1.0, 1.5], 3)
    right = force / 0.2
    given = right * np.repeat([1 - share, 1.0, 1 + share], 3)
    return force, np.stack([given, right], axis=1), list(np.repeat(["ball", "punch", "prism"], 3))


def test_objects_that_are_left_out_choose_the_layer_and_tell_its_error() -> None:
    assert chosen_layer(*objects_of(0.2)) == 1
    assert left_out_share(*objects_of(0.2)) == pytest.approx(0, abs=1e-9)
    force, felt, objects = objects_of(0.2)
    assert left_out_share(force, felt[:, :1], objects) > 0.2


def test_the_layer_that_is_given_stays_where_another_is_hardly_better() -> None:
    force, felt, objects = objects_of(0.2)
    felt[:, 1] = force / 0.2 * np.repeat([0.81, 1.0, 1.19], 3)
    assert chosen_layer(force, felt, objects) == 0


def test_the_error_is_no_smaller_than_on_objects_left_out() -> None:
    assert fit_force(0.2 * FELT, FELT, "record", least_share=0.12).error_share == pytest.approx(0.12)


def test_a_force_is_felt_as_it_was_calibrated_from_the_height_of_the_camera(tmp_path: Path) -> None:
    """Laid over the gel for one of the two alone, a deep touch beside the axis was felt 2 % off."""
    bundle = load_bundle("synthetic")
    assert bundle.manifest.camera_height_mm > 50
    record = ForceRecord.in_bundle(bundle)
    assert record is not None
    with open_camera("sim://?board=0&object=BALL&depth=1.5&x=6") as camera:
        frame = camera.read()
    write_png(tmp_path / "a.png", frame.image)
    felt = felt_in_images(read(tmp_path, "image,force_n\na.png,1\n"), bundle, [record.layer])
    force = Reconstructor(bundle).reconstruct(frame).force
    assert force is not None
    assert record.youngs_modulus_mpa * felt.integral_mm2[0, 0] == pytest.approx(force.normal_n, rel=1e-6)
