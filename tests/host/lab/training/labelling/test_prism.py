"""The edge of a prism in the picture of a press, what is no prism, and what is learnt from its faces."""

import math
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.frames import CameraFrame, Contact, TactileFrame
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training.labelling import PrismContact, find_prism
from gellight.lab.training.labelling.pattern import PixelSample
from gellight.lab.training.labelling.prism_pattern import SIMPLE, EdgeShape, free_response
from gellight.lab.training.prisms import PRISM_COLUMNS, PrismPress, prism_error, read_prisms, with_prisms
from gellight.lab.training.table import PressTable, TableOptions
from gellight.reconstruction.integration import angle_deg, normals
from sim_reference import gel
from sim_reference.camera import CameraResponse, digitise
from sim_reference.deformation import NO_OBJECT, Deformation, grid
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import GRID_EXTENT_MM, GRID_SIZE, Surface
from tests.helpers.derivatives import slope
from tests.helpers.fem_presses import picture

GEOMETRY = SensorGeometry()
SHAPE = GEOMETRY.image_shape
RESPONSE = CameraResponse(noise_grey=1.0)
AT_MM = (2.0, -1.5)


@cache
def pressed(angle: float, turn: float, depth: float, *, long_mm: float = 20.0, lean: float = 0.0, rise: float = 0.0):
    """A prism pressed into the layer: its edge turned in the picture, leaning, rising along its edge; degrees."""
    spacing = GRID_EXTENT_MM / GRID_SIZE
    at = grid(GRID_SIZE, spacing)
    x, y, t = at[None, :], at[:, None], math.radians(turn)
    along, across = x * math.cos(t) + y * math.sin(t), y * math.cos(t) - x * math.sin(t)
    before, behind = (math.tan(math.radians(angle + side * lean)) for side in (-1, 1))
    height = np.where(across > 0, -across * behind, across * before) - along * math.tan(math.radians(rise))
    inside = (np.abs(along) < long_mm / 2) & (np.abs(across) < 5)
    height = np.where(inside, height - height[inside].max(), NO_OBJECT)
    return gel.press(height, spacing, depth, GEOMETRY)


def seen(deformed: Deformation, seed: int = 0) -> tuple[np.ndarray, np.ndarray, Surface]:
    """Picture, reference image and the gel itself."""
    scene = Scene(GEOMETRY, RESPONSE, model=lambda *_: deformed)
    random = np.random.default_rng(seed)
    grey, surface = scene.show(Press("BALL", 0.5, *AT_MM))
    return digitise(grey, 1.0, random), reference(), surface


@cache
def reference() -> np.ndarray:
    random, flat = np.random.default_rng(1), Scene(GEOMETRY, RESPONSE).show(None)[0]
    return np.mean([digitise(flat, 1.0, random) for _ in range(10)], axis=0).astype(np.float32)


def label_error_deg(contact: PrismContact, surface: Surface) -> np.ndarray:
    """Angle between the labelled and the true normals of the pixels that are labelled."""
    press = contact.press(Path())
    faces = press.faces(SHAPE)
    labelled = np.zeros((*SHAPE, 2), np.float32)
    for side in (-1, 1):
        labelled[faces == side] = press.gradient(side)
    error = angle_deg(normals(labelled), normals(surface.gradient_map.astype(np.float32)))
    return np.asarray(error[faces != 0])


@pytest.mark.parametrize(
    ("angle", "turn", "depth"),
    [(15, 130, 0.6), (30, 70, 1.0), (30, -40, 1.5), (30, 0, 0.8), (45, 10, 1.0), (45, 100, 1.5)],
)
def test_an_edge_is_where_it_was_pressed_and_its_labels_are_the_gel_s_slopes(
    angle: float, turn: float, depth: float
) -> None:
    image, untouched, surface = seen(pressed(angle, turn, depth))
    found = find_prism(image, untouched, angle_rad=math.radians(angle))
    press = found.press(Path())
    x, y = AT_MM[0] / GEOMETRY.pixel_size_mm + 319.5, AT_MM[1] / GEOMETRY.pixel_size_mm + 239.5
    across = press.across
    off = (x - found.edge_x1_px) * across[0] + (y - found.edge_y1_px) * across[1]
    assert abs(off) < 0.5
    assert abs(across[0] * math.cos(math.radians(turn)) + across[1] * math.sin(math.radians(turn))) < 0.005
    assert 16 < found.length_px * GEOMETRY.pixel_size_mm < 20
    error = label_error_deg(found, surface)
    assert error.size > 1000
    assert error.mean() < 1.0


@pytest.mark.parametrize("simple", [False, True])
def test_the_jacobian_of_the_fit_is_that_of_finite_differences(simple: bool) -> None:
    random = np.random.default_rng(0)
    x, y, colour = random.uniform(-60, 60, 900), random.uniform(-60, 60, 900), random.normal(0, 20, (900, 3))
    residual = free_response(PixelSample(x=x, y=y, colour=colour), (0.9, 0.4), SIMPLE if simple else range(5))
    at = EdgeShape(turn=0.4, offset=1.3, before=20.0, behind=14.0, widening=0.03, step_length=4.0).vector()
    differences = [slope(lambda vector: residual.left(EdgeShape.of(vector)).T, at, one) for one in np.eye(len(at))]
    np.testing.assert_allclose(residual.jacobian(EdgeShape.of(at)), differences, atol=1e-5)


def test_a_prism_in_the_finite_element_gel_is_found() -> None:
    """Finite elements of 0.3 mm round the edge."""
    image = picture("prism_0.9").image
    found = find_prism(image, reference(), angle_rad=math.radians(30))
    assert found.quality > 0.85
    assert abs(found.lean_deg) < 1
    assert found.length_px * GEOMETRY.pixel_size_mm < 6
    assert found.press(Path()).faces(SHAPE).any()


LEANING = [(30, 1.2, 4.0, 33), (30, 1.2, -8.0, 75), (30, 2.0, 12.0, 10), (45, 1.5, 8.0, -20), (45, 2.0, -12.0, 120)]


@pytest.mark.parametrize(("angle", "depth", "lean", "turn"), LEANING)
def test_a_leaning_prism_is_found_with_its_lean_and_labels_its_own_slopes(
    angle: float, depth: float, lean: float, turn: float
) -> None:
    image, untouched, surface = seen(pressed(angle, turn, depth, lean=lean))
    found = find_prism(image, untouched, angle_rad=math.radians(angle))
    assert abs(found.lean_deg) == pytest.approx(abs(lean), abs=2 * found.lean_error_deg)
    assert found.lean_error_deg < 3
    assert label_error_deg(found, surface).mean() < 0.4 * abs(lean)


def test_a_prism_askew_is_refused_with_how_far_and_what_to_do() -> None:
    image, untouched, _ = seen(pressed(45, 33, 1.5, lean=20.0))
    with pytest.raises(
        InputError, match=r"leans by (1[6-9]|2\d)\.\d \+- \d\.\d degrees to one side \(at most 15\).* upright"
    ):
        find_prism(image, untouched, angle_rad=math.radians(45))
    image, untouched, _ = seen(pressed(30, 33, 1.2, rise=4.0))
    with pytest.raises(InputError, match=r"its edge rises by [34]\.\d \(at most 2\)"):
        find_prism(image, untouched, angle_rad=math.radians(30))


def test_how_far_its_edge_rises_is_told() -> None:
    image, untouched, _ = seen(pressed(30, 50, 1.0, rise=1.0))
    assert abs(find_prism(image, untouched, angle_rad=math.radians(30)).rise_deg) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(
    ("name", "depth", "reason"),
    [
        ("BALL", 1.0, "no prism"),
        ("BALL", 1.5, "no prism"),
        ("CYLINDER", 0.3, "no upright prism"),
        ("TSTEP", 0.6, "no upright prism"),
        ("SINWAVE", 0.5, "no prism"),
        ("PINS", 0.4, "no prism"),
    ],
)
def test_another_object_is_refused(name: str, depth: float, reason: str) -> None:
    grey, _ = Scene(GEOMETRY, RESPONSE).show(Press(name, depth))
    image = digitise(grey, 1.0, np.random.default_rng(0))
    with pytest.raises(InputError, match=reason):
        find_prism(image, reference(), angle_rad=math.radians(30))


def test_nothing_a_round_edge_and_a_shallow_press_are_refused() -> None:
    nothing = digitise(Scene(GEOMETRY, RESPONSE).show(None)[0], 1.0, np.random.default_rng(0))
    with pytest.raises(InputError, match="no press"):
        find_prism(nothing, reference(), angle_rad=math.radians(30))
    with pytest.raises(InputError, match="rounded by"):
        find_prism(picture("cyl_0.5").image, reference(), angle_rad=math.radians(30))
    image, untouched, _ = seen(pressed(30, 20, 0.3))
    with pytest.raises(InputError, match="too shallow"):
        find_prism(image, untouched, angle_rad=math.radians(30))


def csv_of(folder: Path, *rows: str) -> Path:
    place = folder / "prisms.csv"
    head = ",".join([*PRISM_COLUMNS, "rounding_px", "lean_deg", "lean_error_deg", "refused"])
    place.write_text("\n".join([head, *rows]))
    return place


def test_the_table_holds_the_slopes_of_both_faces_not_of_the_edge_and_less_of_the_rim(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((100, 120, 3), 90, np.uint8))
    path = csv_of(tmp_path, "a.png,20,50,100,50,20,30,1.5,,,", "b.png,,,,,,,,,,no prism")
    (press,) = read_prisms(path, image_shape=(100, 120))
    balls = PressTable(rows=np.zeros((2, 7), np.float32), image=np.array([0, 1], np.int32), image_size=(120, 100))
    untouched = np.full((100, 120, 3), 80, np.float32)
    table = with_prisms(balls, [press], untouched, TableOptions(inset_px=0), follow_light=False)
    assert set(table.image.tolist()) == {0, 1, 2}
    rows = table.rows[table.image == 2]
    assert (rows[:, :3] == 10).all()
    down, slope = rows[:, 4] - 50, math.tan(math.radians(30))
    np.testing.assert_array_equal(rows[:, 5], 0)
    np.testing.assert_allclose(rows[:, 6], -np.sign(down) * slope, atol=1e-6)
    wide = np.abs(down)
    assert wide.min() == 4
    assert wide.max() == 19
    assert 0.1 < (wide == 19).sum() / (wide == 10).sum() < 0.4


def test_a_lean_makes_one_face_steeper_where_it_is_sure(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((100, 120, 3), 90, np.uint8))
    rows = ("a.png,20,50,100,50,20,30,1.5,6,1.99,", "a.png,20,50,100,50,20,30,1.5,6,2.01,")
    sure, unsure = read_prisms(csv_of(tmp_path, *rows), image_shape=(100, 120))
    assert [sure.gradient(side)[1] for side in (-1, 1)] == pytest.approx(np.tan(np.radians([36, -24])))
    assert [unsure.gradient(side)[1] for side in (-1, 1)] == pytest.approx(np.tan(np.radians([30, -30])))


def felt_as(surface: Surface) -> TactileFrame:
    """A frame in which the gel is felt as it is."""
    camera_frame = CameraFrame(image=np.zeros((*SHAPE, 3), np.uint8), time_s=0.0, sequence=0)
    gradient_map, depth = surface.gradient_map.astype(np.float32), surface.depth_mm.astype(np.float32)
    return TactileFrame(
        camera_frame=camera_frame, difference=np.zeros((*SHAPE, 3), np.float32), gradient_map=gradient_map,
        depth_mm=depth,
        contact=Contact(mask=surface.contact, area_mm2=0.0, indentation_mm=0.0, centroid_mm=None),
    )  # fmt: skip


@pytest.mark.parametrize("lean", [0.0, 4.0, -8.0, 12.0, 15.0])
def test_a_judge_takes_the_lean_from_the_faces_that_are_felt(lean: float) -> None:
    """Of the gel itself: what is felt without an error; nothing is known of the lean before."""
    _, _, surface = seen(pressed(30, 40, 2.0, lean=lean))
    x, y = AT_MM[0] / GEOMETRY.pixel_size_mm + 319.5, AT_MM[1] / GEOMETRY.pixel_size_mm + 239.5
    along = 80 * np.array([math.cos(math.radians(40)), math.sin(math.radians(40))])
    edge = (x - along[0], y - along[1], x + along[0], y + along[1])
    press = PrismPress(image=Path("prism.png"), edge_px=edge, face_px=22.0, angle_rad=math.radians(30), rounding_px=2.5)
    felt = felt_as(surface)
    error = prism_error(press, felt, (GEOMETRY.pixel_size_mm,) * 2)
    assert error.felt_deg == pytest.approx(30, abs=0.2)
    assert error.lean_deg == pytest.approx(-lean, abs=0.3)  # positive where the face behind is less steep
    assert error.normal_deg < 0.5
    assert error.depth_mm < 0.01
    assert 0 < error.error_deg < 0.2


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("a.png,20,50,130,50,20,30,1.5,,,", "leaves the image"),
        ("a.png,20,50,20,50,20,30,1.5,,,", "no length"),
        ("a.png,20,50,100,50,20,75.1,1.5,,,", "1 to 75"),
        ("a.png,20,50,100,50,wide,30,1.5,,,", "face_px is 'wide'"),
        ("a.png,20,50,100,50,4.9,30,1.5,,,", "press deeper"),
        ("a.png,20,50,100,50,20,0.9,1.5,,,", "1 to 75"),
        ("none.png,20,50,100,50,20,30,1.5,,,", "none.png"),
        ("a.png,,,,,,,,,,shallow", "has no prisms"),
        ("a.png,20,50,100,50,20,30,1.5,-15.1,1,", "lean_deg is -15.1, at most 15 degrees may be"),
        ("a.png,20,50,100,50,20,70,1.5,5.1,1,", "lean_deg is 5.1, at most 5 degrees may be"),
    ],
)
def test_a_wrong_row_is_told(tmp_path: Path, row: str, reason: str) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((100, 120, 3), 90, np.uint8))
    with pytest.raises(InputError, match=reason):
        read_prisms(csv_of(tmp_path, row), image_shape=(100, 120))


@pytest.mark.parametrize(
    "row",
    [
        "a.png,20,50,100,50,5.1,30,1.5,14.9,1,",
        "a.png,20,50,100,50,20,75,1.5,,,",
        "a.png,20,50,100,50,20,1,1.5,,,",
        "a.png,20,50,100,50,20,70,1.5,-4.9,1,",
    ],
)
def test_a_row_that_is_just_possible_is_read(tmp_path: Path, row: str) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((100, 120, 3), 90, np.uint8))
    assert len(read_prisms(csv_of(tmp_path, row), image_shape=(100, 120))) == 1
