"""The network at the means of cells against the network at every pixel, and its Jacobian against differences."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import helper

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Form, Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.opening import open_camera
from gellight.reconstruction import linearised
from gellight.reconstruction.integration import angle_deg, normals
from gellight.reconstruction.network_session import NetworkSession
from tests.benchmarks.frame_times import scenes
from tests.helpers.analytic_surfaces import gaussian
from tests.helpers.linear_sensor import linear_bundle, linear_network, photograph


def session(network: bytes) -> NetworkSession:
    return NetworkSession(network, threads=1, source="test")


def rows(count: int = 500) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.concatenate([rng.normal(0, 20, (count, 3)), rng.uniform(0, 480, (count, 2))], axis=1).astype(np.float32)


def written_before(network: bytes) -> bytes:
    """The network as an older GelLight wrote it: the same weights, without the Jacobian."""
    model = onnx.load_from_string(network)
    for part, name in ((model.graph.node, "jacobian"), (model.graph.input, "with_jacobian"),
                       (model.graph.initializer, "with_jacobian"), (model.graph.output, "jacobian")):  # fmt: skip
        part.remove(next(one for one in part if name in (one.name, *getattr(one, "output", ()))))
    return bytes(model.SerializeToString())


SHIPPED = load_bundle("synthetic").network


@pytest.mark.parametrize("network", [SHIPPED, written_before(SHIPPED)], ids=["shipped", "written before"])
def test_the_jacobian_is_the_limit_of_differences(network: bytes) -> None:
    asked = session(network)
    assert asked.has_jacobian == (network is SHIPPED)
    slopes, jacobian = asked.slopes_and_jacobian(rows())
    np.testing.assert_allclose(slopes, asked.slopes(rows()), rtol=1e-5, atol=1e-6)
    exact = session(SHIPPED).slopes_and_jacobian(rows())[1]
    np.testing.assert_allclose(jacobian, exact, atol=2e-4 * np.abs(exact).max())
    for size, error in ((4.0, 0.05), (1.0, 3e-3), (0.25, 2e-4)):
        step = np.eye(3, 5, dtype=np.float32) * size
        differences = [(asked.slopes(rows() + s) - asked.slopes(rows() - s)) / (2 * size) for s in step]
        left = jacobian.reshape(-1, 2, 3) - np.stack(differences, axis=2)
        assert np.abs(left).max() < error * np.abs(jacobian).max()


@pytest.mark.parametrize("form", [Form.NATIVE, Form.CELLS])
def test_a_bundle_of_an_older_version_gives_the_same_depth(form: Form) -> None:
    bundle = load_bundle("synthetic")
    older = replace(bundle, files={**bundle.files, bundle.manifest.network: written_before(bundle.network)})
    frame = CameraFrame(image=scenes(bundle)["ball"], time_s=0.0, sequence=0)
    found, right = (Reconstructor(one, form=form).reconstruct(frame) for one in (older, bundle))
    assert right.contact.indentation_mm > 0.5
    np.testing.assert_allclose(found.depth_mm, right.depth_mm, atol=1e-5)
    np.testing.assert_allclose(found.gradient_map, right.gradient_map, atol=1e-4)


def test_any_network_runs_at_cells(tmp_path: Path) -> None:
    """Also one that bends at a single place, where no Jacobian tells how."""
    model = onnx.load_from_string(linear_network())
    model.graph.node[0].output[0] = "linear"
    model.graph.node.append(helper.make_node("Relu", ["linear"], ["gradient"]))
    bundle = linear_bundle(tmp_path / "b", (48, 64), network=bytes(model.SerializeToString()))
    frame = photograph(gaussian((48, 64), 6, (0, 0), height=5).gradient_map)
    found, right = (Reconstructor(bundle, form=form).reconstruct(frame) for form in (Form.NATIVE, Form.PIXELS))
    assert np.ptp(right.depth_mm) > 0.05
    np.testing.assert_allclose(found.depth_mm, right.depth_mm, atol=5e-3)


@pytest.mark.parametrize(("shape", "place"), [((240, 320), (20, 10)), ((61, 83), (-20, 10)), ((63, 66), (30, 30))])
def test_a_linear_network_gives_the_same_at_cells_and_at_pixels(
    tmp_path: Path, shape: tuple[int, int], place: tuple[float, float]
) -> None:
    """Also at steep rims, and where the image ends within a cell."""
    bundle = linear_bundle(tmp_path / "b", shape)
    frame = photograph(gaussian(shape, 9, place, height=9).gradient_map, noise_grey=1.0)
    pixels, cells = (Reconstructor(bundle, form=form).reconstruct(frame) for form in (Form.PIXELS, Form.CELLS))
    np.testing.assert_allclose(cells.gradient_map, pixels.gradient_map, atol=2e-5)
    np.testing.assert_allclose(cells.depth_mm, pixels.depth_mm, atol=2e-5)


def every_form(url: str) -> tuple[CameraFrame, dict[Form, TactileFrame]]:
    with open_camera(url) as camera:
        frame = camera.read()
    bundle = load_bundle("synthetic")
    return frame, {form: Reconstructor(bundle, form=form).reconstruct(frame) for form in Form}


@pytest.mark.parametrize("depth_mm", [0.6, pytest.param(1.0, marks=pytest.mark.nightly)])
def test_without_noise_every_form_agrees_with_the_network_at_every_pixel_of_a_ball(depth_mm: float) -> None:
    """Measured: 0.07 degrees at most (0.6 mm), 0.0005 in the mean, 0.46 um."""
    _, found = every_form(f"sim://?board=0&object=BALL&depth={depth_mm}&noise=0")
    pixels = found.pop(Form.PIXELS)
    for tactile in found.values():
        angle = angle_deg(tactile.normal_map.reshape(-1, 3), pixels.normal_map.reshape(-1, 3))
        assert angle.max() < 0.09
        assert angle.mean() < 0.001
        assert np.abs(tactile.depth_mm - pixels.depth_mm).max() < 0.6e-3
        assert tactile.contact.indentation_mm == pytest.approx(pixels.contact.indentation_mm, abs=0.3e-3)
        assert np.count_nonzero(tactile.contact.mask != pixels.contact.mask) < 50


def test_with_noise_no_form_is_further_from_the_ball_than_the_network_at_every_pixel() -> None:
    """But for one per cent: the cells average what a bent network answers to noise, and are linear in between."""
    frame, found = every_form("sim://?board=0&object=BALL&depth=1.0")
    assert frame.truth
    where, right = frame.truth.contact, normals(frame.truth.gradient_map)
    errors = {form: angle_deg(one.normal_map[where], right[where]).mean() for form, one in found.items()}
    assert max(errors.values()) <= 1.01 * errors[Form.PIXELS]
    assert max(np.abs(one.depth_mm - frame.truth.depth_mm).mean() for one in found.values()) < 3e-3  # mm


def test_few_questions_are_enough_for_a_ball() -> None:
    """Of 19 200 cells 4993 lie near the ball, and 4800 blocks in the picture: most of both are not asked about."""
    with open_camera("sim://?board=0&object=BALL&depth=1.0") as camera:
        frame = camera.read()
    reconstructor = Reconstructor(load_bundle("synthetic"), form=Form.NATIVE)
    reconstructor.reconstruct(frame)
    rows = reconstructor.network_rows
    if str(reconstructor.status()["computed_by"]).startswith("C, "):
        assert 0 < rows.cells < 2500
        assert rows.coarse < 200


def test_between_steep_waves_no_cell_is_taken_for_gentle() -> None:
    """A crest differs little from its own block, but the blocks beside it, which it would be blended from, do."""
    bundle = load_bundle("synthetic")
    with open_camera("sim://?board=0&object=WAVE&depth=0.8") as camera:
        frame = camera.read()
    assert frame.truth
    right, where = normals(frame.truth.gradient_map), frame.truth.contact
    forms = {form: Reconstructor(bundle, form=form, cast_shadows=False) for form in Form}
    found = {form: one.reconstruct(frame).normal_map for form, one in forms.items()}
    errors = {form: angle_deg(normal_map[where], right[where]).mean() for form, normal_map in found.items()}
    assert max(errors.values()) < 1.03 * errors[Form.PIXELS]


def planes_of(slope: np.ndarray, jacobian: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """(h, w, 11) planes of cells with slopes (h, w, 2), Jacobians (h, w, 2, 3) and means (h, w, 3)."""
    q = slope - (jacobian * mean[..., None, :]).sum(axis=-1) / 2
    return np.concatenate([q, mean, jacobian.reshape(*mean.shape[:2], 6)], axis=2).astype(np.float32)


def polynomial_planes(quadratic: float, cubic: float, step: float, shape: tuple[int, int] = (6, 7)) -> np.ndarray:
    """Cells whose mean grows by `step` grey levels of red a column; slope x is quadratic r^2 + cubic r^3."""
    mean = np.zeros((*shape, 3))
    mean[..., 0] = red = step * np.arange(shape[1]) - 10.0
    slope, jacobian = np.zeros((*shape, 2)), np.zeros((*shape, 2, 3))
    slope[..., 0] = quadratic * red**2 + cubic * red**3
    jacobian[..., 0, 0] = 2 * quadratic * red + 3 * cubic * red**2
    return planes_of(slope, jacobian, mean)


@pytest.mark.parametrize("step", [4.0, 9.0])
def test_the_bend_of_a_quadratic_is_its_second_derivative_and_nothing_is_a_misfit(step: float) -> None:
    bend, misfit = np.moveaxis(linearised.doubts(polynomial_planes(0.003, 0, step), np.ones((6, 7), bool)), 2, 0)
    np.testing.assert_allclose(np.sqrt(bend) * 0.04, 2 * 0.003, rtol=1e-4)
    np.testing.assert_allclose(misfit, 0, atol=1e-8)


def test_the_misfit_of_a_cubic_is_half_of_the_cube_of_the_step() -> None:
    """r_j^3 - r_i^3 - 3 (r_i^2 + r_j^2) (r_j - r_i) / 2 = -(r_j - r_i)^3 / 2."""
    misfit = linearised.doubts(polynomial_planes(0, 1e-4, 9.0), np.ones((6, 7), bool))[..., 1]
    np.testing.assert_allclose(np.sqrt(misfit) * 0.4, 1e-4 * 9.0**3 / 2, rtol=1e-3)


def test_cells_that_are_not_near_tell_nothing() -> None:
    planes, near = polynomial_planes(0.003, 1e-4, 9.0), np.ones((6, 7), bool)
    near[:, 4:] = False
    planes[:, 4:] = 1e6
    right = linearised.doubts(polynomial_planes(0.003, 1e-4, 9.0)[:, :4], np.ones((6, 4), bool))
    np.testing.assert_array_equal(linearised.doubts(planes, near)[:, :4], right)


@pytest.fixture(scope="module")
def steep() -> dict[Form, tuple[TactileFrame, int]]:
    """Steep waves, in colours that the network has not learned from, and how many pixels it was asked about."""
    bundle = load_bundle("synthetic")
    frame = CameraFrame(image=scenes(bundle)["all touched, steep"], time_s=0.0, sequence=0)
    found = {}
    for form in Form:
        reconstructor = Reconstructor(bundle, form=form)
        found[form] = reconstructor.reconstruct(frame), reconstructor.network_rows.pixels
    return found


@pytest.mark.parametrize("form", [form for form in Form if form is not Form.PIXELS])
def test_cells_are_not_trusted_where_their_answers_do_not_fit_their_jacobians(
    steep: dict[Form, tuple[TactileFrame, int]], form: Form
) -> None:
    """Measured: 15.5 and 0.55 degrees, 17 % of the pixels asked about."""
    found, pixels = steep[form][0], steep[Form.PIXELS][0]
    angle = angle_deg(found.normal_map.reshape(-1, 3), pixels.normal_map.reshape(-1, 3))
    assert angle.max() < 17
    assert angle.mean() < 0.6
    assert steep[form][1] < 0.18 * angle.size
