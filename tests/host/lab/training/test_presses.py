"""Labelled presses: the slopes of a ball, and everything that can be wrong with a label."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle, write_bundle
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.presses import SUNKEN, Ball, Press, cap_depth_mm, contact_circle, sphere_gradient
from gellight.lab.training.table import (
    PressTable,
    TableOptions,
    build_table,
    drift_of_presses,
    images_of,
    under_light_of,
)

SHAPE = (120, 160)
BALL = Ball(radius_mm=4.0, pixel_size_mm=0.1)
HEADER = "image,center_x_px,center_y_px,contact_radius_px\n"


def press(x: float = 80.0, y: float = 50.0, radius: float = 20.0, name: str = "a.png") -> Press:
    return Press(image=Path(name), center_x_px=x, center_y_px=y, contact_radius_px=radius)


def write_image(path: Path, value: int = 100, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    image = np.full((*shape, 3), value, np.uint8)
    image[..., 0] += np.arange(shape[1], dtype=np.uint8) // 2
    cv2.imwrite(str(path), image[..., ::-1])
    return image


def write_csv(folder: Path, *lines: str, header: str = HEADER) -> Path:
    path = folder / "presses.csv"
    path.write_text(header + "\n".join(lines) + "\n")
    return path


def test_the_ball_is_deepest_in_the_middle_and_its_rim_is_at_zero() -> None:
    depth = cap_depth_mm(press(), BALL, SHAPE)
    assert np.nanargmax(depth) == 50 * SHAPE[1] + 80
    assert depth[50, 80] == pytest.approx(4.0 - np.sqrt(16 - 4), abs=1e-6)
    assert depth[50, 100] == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(depth[119, 0])


def test_the_slopes_are_the_derivatives_of_the_depth() -> None:
    depth = cap_depth_mm(press(), BALL, SHAPE).astype(np.float64)
    gradient = sphere_gradient(press(), BALL, SHAPE)
    inside = contact_circle(press(), SHAPE)
    along_y, along_x = np.gradient(depth, BALL.pixel_size_mm)
    np.testing.assert_allclose(gradient[inside, 0], along_x[inside], atol=1e-3)
    np.testing.assert_allclose(gradient[inside, 1], along_y[inside], atol=1e-3)


def test_the_contact_circle_has_the_area_of_a_circle() -> None:
    assert contact_circle(press(80.3, 50.6), SHAPE).sum() == pytest.approx(np.pi * 400, rel=0.02)


def test_a_camera_above_the_gel_sees_the_ball_where_its_rays_meet_it() -> None:
    height, radius, rim = 53.1, 4.0, 2.0
    place, cap = np.array([4.0, -3.0]), radius - np.sqrt(radius**2 - rim**2)
    sunken = SUNKEN * cap
    nearer, middle = height / (height - sunken), (np.array(SHAPE[::-1]) - 1) / 2
    seen = press(*(place * nearer / 0.1 + middle).tolist(), rim * nearer / 0.1)
    ball = replace(BALL, camera_height_mm=height)
    inside = contact_circle(seen, SHAPE)
    slopes = sphere_gradient(seen, ball, SHAPE)[inside].astype(np.float64)
    normal = np.concatenate([-slopes, np.ones((len(slopes), 1))], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    depth = sunken - np.sqrt(radius**2 - rim**2) + radius * normal[:, 2]
    pixels = (np.argwhere(inside)[:, ::-1] - middle) * 0.1
    assert np.abs(place + radius * normal[:, :2] - pixels * (1 - depth / height)[:, None]).max() < 1e-3
    np.testing.assert_allclose(cap_depth_mm(seen, ball, SHAPE)[inside], depth - sunken, rtol=0, atol=3e-3)
    # Along parallel rays the same picture would be labelled by up to a degree off.
    assert 0.005 < np.abs(slopes - sphere_gradient(seen, BALL, SHAPE)[inside]).mean() < 0.02


def test_good_presses_are_read(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        write_image(tmp_path / name)
    path = write_csv(tmp_path, "a.png,80.5,50,20", "b.png,-10,100,39.9")
    first, second = read_presses(path, ball=BALL, image_shape=SHAPE)
    assert (first.image, first.center_x_px, first.contact_radius_px) == (tmp_path / "a.png", 80.5, 20.0)
    assert (second.center_x_px, second.center_y_px) == (-10.0, 100.0)


WRONG = {
    "ball too small": ("a.png,80,50,40", "line 2: contact_radius_px is 40, but .* radius 4 mm is only 40.00 px"),
    "no radius": ("a.png,80,50,0", "line 2: contact_radius_px is 0: give a radius greater than 0"),
    "nan": ("a.png,nan,50,20", "line 2: center_x_px is 'nan': give a number"),
    "text": ("a.png,80,middle,20", "line 2: center_y_px is 'middle'"),
    "short line": ("a.png,80,50", "line 2: contact_radius_px is None"),
    "outside": (
        "a.png,180,50,20",
        r"line 2: .*\(180, 50\) px, 20 px in radius, holds no pixel of the image of 160",
    ),
    "between": ("a.png,20.5,20.5,0.7", "holds no pixel"),
    "above": ("a.png,80,-21,20", r"\(80, -21\) px, 20 px in radius, holds no pixel"),
    "no image": ("c.png,80,50,20", "line 2: image .*c.png does not exist"),
    "no name": (",80,50,20", "line 2: column image is empty"),
    "twice": ("a.png,80,50,20\na.png,81,50,20", "line 3: image a.png is already in line 2"),
    "broken image": ("broken.png,80,50,20", "line 2: .*broken.png is not an image"),
    "other size": ("small.png,50,40,20", "line 2: image small.png is 100 x 80 px, the reference image is 160 x 120"),
    "nothing": ("", "has no presses"),
}


@pytest.mark.parametrize(("lines", "message"), WRONG.values(), ids=WRONG)
def test_a_wrong_label_is_named_with_its_line_and_value(lines: str, message: str, tmp_path: Path) -> None:
    write_image(tmp_path / "a.png")
    write_image(tmp_path / "small.png", shape=(80, 100))
    (tmp_path / "broken.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match=message):
        read_presses(write_csv(tmp_path, lines), ball=BALL, image_shape=SHAPE)


def test_blanks_around_names_of_columns_do_not_matter(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png")
    path = write_csv(tmp_path, "a.png, 80, 50, 20", header="image, center_x_px,center_y_px , contact_radius_px\n")
    assert read_presses(path, ball=BALL, image_shape=SHAPE)[0].center_y_px == 50


def test_a_file_without_the_columns_is_refused(tmp_path: Path) -> None:
    path = write_csv(tmp_path, "a.png,1,2", header="image,center_x_px,radius\n")
    with pytest.raises(InputError, match="has no column center_y_px, contact_radius_px"):
        read_presses(path, ball=BALL, image_shape=SHAPE)
    with pytest.raises(InputError, match="cannot be opened"):
        read_presses(tmp_path / "none.csv", ball=BALL, image_shape=SHAPE)
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError, match="not a csv file"):
        read_presses(path, ball=BALL, image_shape=SHAPE)


@pytest.mark.parametrize("radius", [0.0, -1.0, float("nan"), float("inf")])
def test_a_ball_has_a_size(radius: float) -> None:
    with pytest.raises(InputError, match="radius_mm"):
        Ball(radius_mm=radius, pixel_size_mm=0.1)


def test_the_table_holds_colour_place_and_slope_of_the_same_pixel(tmp_path: Path) -> None:
    image = write_image(tmp_path / "a.png")
    reference = np.full((*SHAPE, 3), 90.25, np.float32)
    only = Press(image=tmp_path / "a.png", center_x_px=80, center_y_px=50, contact_radius_px=20)
    options = TableOptions(inset_px=2, flat_share=0.5, flat_distance=2.0)
    table = build_table([only], reference, BALL, options)
    x, y = table.rows[:, 3].astype(int), table.rows[:, 4].astype(int)
    np.testing.assert_array_equal(table.rows[:, :3], image[y, x] - reference[y, x])
    distance = np.hypot(x - 80, y - 50)
    contact = distance < 18
    np.testing.assert_array_equal(table.rows[contact, 5:], sphere_gradient(only, BALL, SHAPE)[y[contact], x[contact]])
    assert (table.rows[~contact, 5:] == 0).all()
    assert distance[~contact].min() > 40
    assert contact.sum() == pytest.approx(np.pi * 18**2, rel=0.02)
    assert (~contact).sum() == round(0.5 * contact.sum())
    assert table.image_size == (160, 120)


def test_each_row_knows_its_press(tmp_path: Path) -> None:
    places = (("a.png", 40.0), ("b.png", 120.0))
    presses = []
    for name, x in places:
        write_image(tmp_path / name)
        presses.append(Press(image=tmp_path / name, center_x_px=x, center_y_px=60, contact_radius_px=15))
    table = build_table(presses, np.zeros((*SHAPE, 3), np.float32), BALL, TableOptions(flat_share=0.0))
    for number, (_, x) in enumerate(places):
        assert np.abs(table.rows[table.image == number, 3] - x).max() < 15


def test_a_circle_that_its_inset_swallows_is_refused(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png")
    tiny = Press(image=tmp_path / "a.png", center_x_px=80, center_y_px=50, contact_radius_px=3)
    with pytest.raises(InputError, match="no pixel is left of a contact circle of 3 px"):
        build_table([tiny], np.zeros((*SHAPE, 3), np.float32), BALL, TableOptions(inset_px=3))


def test_several_presses_of_one_image_are_learnt_from_and_divided_by_image(tmp_path: Path) -> None:
    image = np.full((120, 160, 3), 100, np.uint8)
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(tmp_path / name), image)
    one, other, third = (
        Press(image=tmp_path / name, center_x_px=x, center_y_px=60.0, contact_radius_px=15.0)
        for name, x in (("a.png", 40.0), ("a.png", 110.0), ("b.png", 60.0))
    )
    np.testing.assert_array_equal(images_of([one, other, third]), [0, 0, 1])
    np.testing.assert_array_equal(images_of([one, other]), [0, 1])  # of one picture alone, each by itself
    ball = Ball(radius_mm=4, pixel_size_mm=0.1)
    table = build_table([one, other, third], image.astype(np.float32), ball, TableOptions(flat_share=1.0))
    assert set(table.image.tolist()) == {0, 1}
    flat = (table.rows[:, 5:] == 0).all(axis=1) & (table.image == 0)
    assert flat.sum() > 500
    for press in (one, other):  # what is flat for one press is not in the contact of the other
        away = np.hypot(table.rows[flat, 3] - press.center_x_px, table.rows[flat, 4] - press.center_y_px)
        assert np.sort(away)[2] > 1.9 * 15  # but for the middles of the balls, which are level


@pytest.mark.parametrize(("light", "grey"), [(1.0, 0.0), (0.9, 12.6), (1.1, 10.3)])
def test_how_far_the_light_of_presses_is_from_the_references(tmp_path: Path, light: float, grey: float) -> None:
    image = write_image(tmp_path / "a.png")
    presses = [replace(press(), image=tmp_path / "a.png")]
    assert drift_of_presses(presses, (image / light).astype(np.float32)) == pytest.approx(grey, abs=0.2)


def test_a_press_under_light_that_cannot_be_taken_out_is_refused_by_its_name(tmp_path: Path) -> None:
    image = write_image(tmp_path / "a.png")
    presses = [replace(press(), image=tmp_path / "a.png")]
    with pytest.raises(InputError, match=r"a\.png: the light differs from the reference's by up to 40%, at most 30%"):
        drift_of_presses(presses, (image / 0.6).astype(np.float32))


def test_the_rim_of_a_circle_that_a_hand_drew_weighs_less(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png")
    write_image(tmp_path / "b.png")
    path = write_csv(tmp_path, "a.png,80,50,30,", "b.png,80,50,30,0.97", header=HEADER.strip() + ",quality\n")
    drawn, found = read_presses(path, ball=BALL, image_shape=SHAPE)
    options = TableOptions(flat_share=0.0, inset_px=0.0, rim_share=0.25)
    table = build_table([drawn, found], np.zeros((*SHAPE, 3), np.float32), BALL, options)
    distance = np.hypot(table.rows[:, 3] - 80, table.rows[:, 4] - 50)
    rims, inner = ([((table.image == i) & part).sum() for i in (0, 1)] for part in (distance > 27, distance <= 27))
    assert inner[0] == inner[1]
    assert rims[0] == pytest.approx(0.25 * rims[1], rel=0.2)


def test_presses_of_a_like_unit_are_made_as_bright_as_this_units_gel_at_their_place(tmp_path: Path) -> None:
    random, (height, width) = np.random.default_rng(0), (24, 32)
    theirs, ours = random.integers(2, 200, (2, height, width, 3)).astype(np.float32)
    x, y = random.integers(0, width, 50), random.integers(0, height, 50)
    rows = np.column_stack([random.normal(size=(50, 3)), x, y, random.normal(size=(50, 2))]).astype(np.float32)
    table = PressTable(rows=rows, image=np.zeros(50, np.int32), image_size=(width, height))
    bundle = write_bundle(
        tmp_path / "like", sensor="theirs", reference=theirs, reference_frames=1, noise_grey=1.0,
        pixel_size_mm=(0.1, 0.1), network=load_bundle("synthetic").network, metrics={}, presses=table.arrays(),
    )  # fmt: skip
    found = under_light_of(bundle, ours).rows
    brighter = np.maximum(ours[y, x], 20.0) / np.maximum(theirs[y, x], 20.0)
    np.testing.assert_allclose(found[:, :3], rows[:, :3] * brighter, rtol=1e-4)
    np.testing.assert_array_equal(found[:, 3:], rows[:, 3:])
    with pytest.raises(InputError, match="is no like unit"):
        under_light_of(bundle, ours[:, :-4])
