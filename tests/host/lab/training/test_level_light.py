"""Presses as they would look at the depth of the gel at rest: against the simulator's picture of such a gel."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training import training
from gellight.lab.training.level_light import TrainingData, at_rest_depth, with_lights
from gellight.lab.training.presses import Ball
from gellight.lab.training.presses import Press as Labelled
from gellight.lab.training.table import PressTable, TableOptions, build_table
from gellight.lab.training.training import Learning, Reference, fit
from gellight.photometric.lights_file import FILE_NAME, has_lights, read_lights
from sim_reference.camera import CameraResponse, linear_grey
from sim_reference.geometry import AS_BUILT
from sim_reference.imaging import ring_irradiance, ring_light
from sim_reference.surface import Surface

SYNTHETIC = load_bundle("synthetic")
LIGHTS = read_lights(SYNTHETIC)
GEOMETRY = AS_BUILT
SIZE = (GEOMETRY.pixel_size_mm, GEOMETRY.pixel_size_mm)
BALL = Ball(radius_mm=4.0, pixel_size_mm=GEOMETRY.pixel_size_mm)


def test_colours_are_those_of_the_same_slopes_at_rest() -> None:
    scene = Scene(GEOMETRY, CameraResponse(noise_grey=0.0))
    grey, surface = scene.show(Press("BALL", 1.0, 2.0, -3.0))
    level = Surface(np.zeros_like(surface.depth_mm), surface.gradient_map, surface.contact)
    wanted = linear_grey(ring_irradiance(level, GEOMETRY, ring_light(GEOMETRY)), scene.response)
    row, column = np.nonzero(surface.contact)
    reference = SYNTHETIC.reference
    colours = (grey - reference)[row, column]
    rows = np.column_stack([colours, column, row, surface.gradient_map[row, column]]).astype(np.float32)
    depth_mm = surface.depth_mm[row, column].astype(np.float32)
    table = PressTable(rows=rows, image=np.zeros(len(rows), np.int32), image_size=(640, 480), depth_mm=depth_mm)
    found = at_rest_depth(table, LIGHTS, reference, SIZE, SYNTHETIC.manifest.camera_height_mm)
    off, before = (np.abs(one[:, :3] - (wanted - reference)[row, column]).mean() for one in (found.rows, rows))
    assert before > 0.8
    assert off < 0.1
    np.testing.assert_array_equal(found.rows[:, 3:], rows[:, 3:])


def test_lights_show_slopes_in_all_places_as_the_reference_does() -> None:
    """Those of a table, and those that are drawn: by the angles of the table, three in ten by any up to 63 degrees."""
    slopes = np.tan(np.radians([[10.0, 0.0], [-20.0, 15.0], [5.0, -25.0]])).astype(np.float32)
    rows = np.column_stack([np.zeros((3, 3)), [[60, 40], [320, 240], [600, 450]], slopes]).astype(np.float32)
    table = PressTable(rows=rows, image=np.zeros(3, np.int32), image_size=(640, 480), depth_mm=np.zeros(3, np.float32))
    _, _, lit = with_lights(table, None, LIGHTS, SYNTHETIC.reference, SIZE)
    drawn = lit["lit_rows"]
    response, light = Scene(GEOMETRY, CameraResponse(noise_grey=0.0)).response, ring_light(GEOMETRY)
    for colours, of in ((lit["lit"], rows), (drawn[:, :3], drawn)):
        some = of[:3000]
        column, row = some[:, 3:5].astype(int).T
        maps = np.zeros((*GEOMETRY.image_shape, 2))
        maps[row, column] = some[:, 5:]
        level = Surface(np.zeros(maps.shape[:2]), maps, np.ones(maps.shape[:2], np.bool_))
        wanted = (linear_grey(ring_irradiance(level, GEOMETRY, light), response) - SYNTHETIC.reference)[row, column]
        alone = (maps[row, column] == some[:, 5:]).all(axis=1)  # no other row of the same pixel
        assert np.abs(colours[:3000] - wanted)[alone].mean() < 0.3
    angle = np.arctan(np.hypot(*drawn[:, 5:].T))
    assert len(drawn) == 300_000
    of_table = np.isclose(angle[:, None], np.arctan(np.hypot(*slopes.T)), atol=1e-4).any(axis=1)
    assert of_table.mean() == pytest.approx(0.7, abs=0.01)
    assert angle[~of_table].max() == pytest.approx(1.1, abs=0.01)


def test_a_table_that_does_not_know_its_depth_stays_as_it_is() -> None:
    table = PressTable(rows=np.ones((4, 7), np.float32), image=np.zeros(4, np.int32), image_size=(640, 480))
    assert at_rest_depth(table, LIGHTS, SYNTHETIC.reference, SIZE) is table
    assert with_lights(table, None, LIGHTS, SYNTHETIC.reference, SIZE) == TrainingData(table)


def labelled(folder: Path, x: float, y: float, radius_px: float = 40.0) -> Labelled:
    image = folder / f"{x:g}.png"
    cv2.imwrite(str(image), SYNTHETIC.reference.astype(np.uint8)[..., ::-1])
    return Labelled(image=image, center_x_px=x, center_y_px=y, contact_radius_px=radius_px)


def test_the_depth_of_a_row_is_the_cap_over_a_rim_that_has_sunk(tmp_path: Path) -> None:
    press = labelled(tmp_path, 300.0, 200.0)
    table = build_table([press], SYNTHETIC.reference, BALL, TableOptions(inset_px=0.0, flat_share=0.1))
    away_px = np.hypot(table.rows[:, 3] - 300, table.rows[:, 4] - 200)
    pixel = GEOMETRY.pixel_size_mm
    top = 4.0 - np.sqrt(16 - (40 * pixel) ** 2)
    inside = away_px < 40
    cap = np.sqrt(16 - (away_px[inside] * pixel) ** 2) - np.sqrt(16 - (40 * pixel) ** 2)
    np.testing.assert_allclose(table.depth_mm[inside], cap + 0.45 * top, atol=1e-5)
    assert np.count_nonzero(~inside) > 100
    assert not table.depth_mm[~inside].any()


def test_the_bundle_keeps_the_colours_as_they_were_and_says_what_its_network_answers_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    learnt = []

    def train(of: TrainingData, *_: object, **__: object) -> tuple[bytes, dict[str, object]]:
        learnt.append(of)
        return SYNTHETIC.network, {"losses": []}

    monkeypatch.setattr(training, "train", train)
    presses = [labelled(tmp_path, x, 200.0) for x in (200.0, 400.0)]
    reference = Reference(image=SYNTHETIC.reference, frames=10, noise_grey=1.0)
    made: dict[bool, Bundle] = {}
    for known in (True, False):
        how = Learning(lights=LIGHTS if known else None)
        made[known] = fit(presses, reference, BALL, tmp_path / f"{known}", sensor="one", how=how)
    kept, raw = PressTable.of(made[True]), PressTable.of(made[False])
    np.testing.assert_array_equal(kept.rows, raw.rows)
    np.testing.assert_array_equal(kept.depth_mm, raw.depth_mm)
    (level, _, lit), (looks, _, unlit) = learnt
    assert (sorted(lit), unlit) == (["lit", "lit_rows"], None)
    np.testing.assert_array_equal(looks.rows, raw.rows)
    assert np.abs(level.rows - kept.rows).max() > 1
    assert [made[known].manifest.light_by_depth for known in (True, False)] == [True, False]
    assert [has_lights(made[known]) for known in (True, False)] == [True, False]

    # The presses of a like unit are learnt from alike.
    fit(presses, reference, BALL, tmp_path / "like", sensor="two", how=Learning(lights=LIGHTS, like=made[True]))
    again, of_like, _ = learnt[-1]
    np.testing.assert_allclose(of_like.rows, again.rows, atol=1e-3)


def test_a_network_of_level_light_without_the_lights_is_refused() -> None:
    files = {name: content for name, content in SYNTHETIC.files.items() if name != FILE_NAME}
    with pytest.raises(BundleError, match=r"has no lights\.json"):
        Reconstructor(replace(SYNTHETIC, files=files))
