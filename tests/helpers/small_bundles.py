"""Bundles for pictures of 160 x 120 px of the simulated sensor, made from the one that comes with GelLight.

Every pixel is the mean of 4 x 4 of its: the same gel under the same light, with a known answer, and quick.
"""

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import onnx
from numpy.polynomial import chebyshev
from onnx import numpy_helper

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frames.dots import Dots
from gellight.frames.picture import PictureSteps
from gellight.frames.pixel_grid import block_means
from gellight.frames.view import View
from gellight.lab.simulator.scene import Press, Scene
from gellight.photometric.directions import LightDirections, lights_of, view_places
from gellight.photometric.light_model import LightGroups
from gellight.photometric.lights_file import read_lights
from gellight.photometric.solver import flat_gel, light_rows
from gellight.series.single_light_path import change_percent
from gelnet.export import export
from gelnet.numpy_trainer import NumpyTrainer
from gelnet.recipes import RECIPES
from gelnet.table import Table
from gelnet.training import train
from sim_reference.camera import CameraResponse
from sim_reference.geometry import AS_BUILT

WHOLE_SHAPE = (480, 640)
BLOCK = 4
SHAPE = (120, 160)
PIXEL_MM = 0.0588 * BLOCK
BOX = (16, 12, 128, 96)
"""x, y, width and height of the view, px"""
MIDDLE_MM = 6.0
"""from the middle of the gel: lights are linear in the place there, and balls are pressed"""


def ordinary(block: int = BLOCK) -> Bundle:
    """GelNet, and the lights for photometric stereo, for pictures of the means of so many pixels each way."""
    whole = load_bundle("synthetic")
    means, pixel_mm = block_means(whole.reference, block), whole.pixel_size_mm[0] * block
    lights = json.loads(whole.files["lights.json"])
    lights["patterns"] = {
        kind: at_blocks(np.array(pattern), block).tolist() for kind, pattern in lights["patterns"].items()
    }
    lights["image_height_px"], lights["image_width_px"] = means.shape[:2]
    files = {
        "metrics.json": whole.files["metrics.json"],
        "lights.json": json.dumps(lights).encode(),
        whole.manifest.network: at_places(whole.network, block, (block - 1) / 2, (block - 1) / 2),
    }
    return sized(replace(whole, files=files, source="ordinary"), means, pixel_mm)


def at_blocks(patterns: np.ndarray, block: int) -> np.ndarray:
    """Return (K, i, j) Chebyshev coefficients over -1 to 1, from those of the whole picture, for the blocks' centres.

    The outermost centres lie (block - 1) / 2 px inside of those of the pixels.
    """
    nodes = np.cos(np.pi * (np.arange(patterns.shape[1]) + 0.5) / patterns.shape[1])
    back = np.linalg.inv(chebyshev.chebvander(nodes, len(nodes) - 1))
    down, across = (
        back @ chebyshev.chebvander(nodes * (1 - (block - 1) / (size - 1)), len(nodes) - 1) for size in WHOLE_SHAPE
    )
    return np.asarray(np.einsum("ai,kij,bj->kab", down, patterns, across))


def sized(bundle: Bundle, reference: np.ndarray, pixel_mm: float) -> Bundle:
    """Return the bundle with a (H, W, 3) reference of another size."""
    size = {"image_width_px": reference.shape[1], "image_height_px": reference.shape[0]}
    manifest = bundle.manifest.model_copy(update={**size, "pixel_size_mm": (pixel_mm, pixel_mm)})
    frames = bundle.manifest.reference_frames
    return replace(bundle, manifest=manifest).with_reference(np.ascontiguousarray(reference), frames=frames)


def at_places(network: bytes, scale: float, x_px: float, y_px: float) -> bytes:
    """Return GelNet for pixels that lie at `scale` times their place plus (x, y) px in its own picture."""
    model = onnx.load_from_string(network)
    tensors = {tensor.name: tensor for tensor in model.graph.initializer}
    weight, bias = (numpy_helper.to_array(tensors[name]).copy() for name in ("weight_1", "bias_1"))
    bias += weight[:, 3:] @ np.array([x_px, y_px], np.float32)
    weight[:, 3:] *= scale
    for name, values in (("weight_1", weight), ("bias_1", bias)):
        tensors[name].CopyFrom(numpy_helper.from_array(values, name))
    return bytes(model.SerializeToString())


def with_files(bundle: Bundle, source: str, **files: bytes) -> Bundle:
    """Return the bundle with more files, sealed anew; `__` in a name is a dot."""
    named = {name.replace("__", "."): content for name, content in files.items()}
    more = replace(bundle, files={**bundle.files, **named}, source=source)
    return more.with_reference(bundle.reference, frames=bundle.manifest.reference_frames)


def with_lens(bundle: Bundle, **changes: object) -> Bundle:
    """Return it with a lens that bends by less than a tenth of a pixel, of a small picture; changes: of its record."""
    (height, width), (across_mm, down_mm) = bundle.image_shape, bundle.pixel_size_mm
    record = {
        "image_width_px": width, "image_height_px": height, "centre_px": ((width - 1) / 2, (height - 1) / 2),
        "k1": 1e-3, "k2": 0.0, "px_per_mm": (1 / across_mm, 0.0, 1 / down_mm), "origin_mm": (0.0, 0.0),
        "learnt_from_circles": False, "pitch_mm": 2.0, "images": ["grid.png"], "pins": 40, "rms_before_px": 0.1,
        "rms_after_px": 0.05, "created": datetime.now(UTC).isoformat(), **changes,
    }  # fmt: skip
    return with_files(bundle, "lens", lens__json=json.dumps(record).encode())


def with_view(bundle: Bundle) -> Bundle:
    """Return it for the part `BOX` of the picture."""
    x, y, width, height = BOX
    network = {bundle.manifest.network.replace(".", "__"): at_places(bundle.network, 1, x, y)}
    files = {name: content for name, content in bundle.files.items() if name != "lights.json"}
    as_it_looks = bundle.manifest.model_copy(update={"light_by_depth": False})
    cut = replace(bundle, files=files, manifest=as_it_looks)
    seen = sized(cut, bundle.reference[y : y + height, x : x + width], PIXEL_MM)
    steps = PictureSteps.with_view(View.of_box(BOX, SHAPE)).files()["picture.json"]
    return with_files(seen, "view", picture__json=steps, **network)


def with_dots(bundle: Bundle) -> Bundle:
    """Return it with marker dots to fill, darker than anything that the gel shows."""
    steps = PictureSteps.of(SHAPE, None, Dots(diameter_px=4, darker_grey=120, count=9))
    assert steps is not None
    return with_files(bundle, "dots", picture__json=steps.files()["picture.json"])


def with_directions(bundle: Bundle) -> Bundle:
    """Return it for four groups of three lights, shown in turn, with a network that was trained on balls under them.

    The vectors are those of its light model, linear in the place within `MIDDLE_MM`, where the balls are pressed.
    """
    model = read_lights(bundle)
    groups = model.groups(LightGroups.TRIPLES)
    references = model.references(LightGroups.TRIPLES).reshape(12, -1)
    alone = light_rows(flat_gel(SHAPE, (PIXEL_MM, PIXEL_MM)), references, model.ring)  # (12, 3, N), LED by LED
    places = view_places(SHAPE, np.arange(SHAPE[0] * SHAPE[1]))
    middle = np.hypot(*(places[1:] * (np.array([SHAPE[1], SHAPE[0]])[:, None] - 1) / 2)) * PIXEL_MM < MIDDLE_MM
    channels = np.array(model.ring.channels)
    vectors, untouched = [], []
    for group, colour in lights_of(groups):
        lit = np.flatnonzero(groups[group].any(axis=1))
        rows = np.einsum("l,lin->in", model.crosstalk[colour, channels[lit]], alone[lit])
        vectors.append(np.linalg.lstsq(places[:, middle].T, (rows / rows[2])[:, middle].T, rcond=None)[0].T)
        untouched.append(rows[2].reshape(SHAPE))
    lights = LightDirections(vectors=np.stack(vectors), untouched=np.stack(untouched).astype(np.float32),
                             noise_grey=bundle.manifest.noise_grey, pixel_size_mm=PIXEL_MM, groups=groups,
                             camera_height_mm=bundle.manifest.camera_height_mm)  # fmt: skip
    files = {bundle.manifest.network.replace(".", "__"): trained_on_balls(lights)}
    return with_files(bundle, "directions", directions__npz=lights.content(), **files)


def trained_on_balls(lights: LightDirections, presses: int = 15) -> bytes:
    """Return GelNet trained on balls somewhere near the middle, under the lights; 3 s of processor time."""
    sensor = replace(AS_BUILT, image_width_px=SHAPE[1], image_height_px=SHAPE[0], pixel_size_mm=PIXEL_MM)
    scene, random = Scene(sensor, CameraResponse()), np.random.default_rng(0)
    parts = [ball_rows(scene, lights, random) for _ in range(presses)]
    image = np.repeat(np.arange(presses, dtype=np.int32), list(map(len, parts)))
    table = Table(rows=np.concatenate(parts), image=image, image_size=(SHAPE[1], SHAPE[0]))
    recipe = replace(RECIPES["thorough"], epochs=60, least_visits=0)
    learnt = train(table, recipe, NumpyTrainer(seed=0), width=24).network
    with TemporaryDirectory() as folder:
        path = Path(folder) / "network.onnx"
        export(learnt.parameters(), path, rows=table.pixels[:500], answer=learnt.answer)
        return path.read_bytes()


def ball_rows(scene: Scene, lights: LightDirections, random: np.random.Generator) -> np.ndarray:
    """Return (N, K + 4) rows of a table: the pixels that a ball tilts, and a third as many others."""
    press = Press("BALL", random.uniform(0.4, 1.3), *random.uniform(-0.8, 0.8, 2) * MIDDLE_MM)
    shown = [scene.show(press, group / 255) for group in lights.groups]
    levels = np.stack([shown[group][0][..., colour] for group, colour in lights_of(lights.groups)])
    noisy = (levels + random.normal(0, scene.response.noise_grey, levels.shape)).astype(np.float32)
    slope = shown[0][1].gradient_map.reshape(-1, 2)
    tilted = np.hypot(*slope.T) > 0.02
    kept = [np.flatnonzero(tilted), random.choice(np.flatnonzero(~tilted), tilted.sum() // 3)]
    y, x = np.indices(SHAPE).reshape(2, -1)
    rows = np.column_stack([change_percent(noisy, lights.untouched), x, y, slope])
    return np.asarray(rows[np.concatenate(kept)], np.float32)
