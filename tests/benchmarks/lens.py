"""What taking out a lens is worth, and what it costs: `python -m tests.benchmarks.lens [K1]`.

Pictures of the simulated gel go through a lens of known barrel distortion. GelNet is trained on contact circles drawn
in those pictures, the lens is measured from a picture of a pin grid, and fresh presses are compared with the true
surface. Three ways: without the lens, with it, and with it but taking the network's slopes for true ones.

`python -m tests.benchmarks.lens maps`: how right the maps of random lenses are.
"""

import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from gellight.bundle.bundle import Bundle, extend_bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.lab.optics.lens.lens_fit import fit_lens, read_pins, spacing_px
from gellight.lab.optics.lens.measuring import add_lens, felt_depth_mm, figures, measure_lens
from gellight.lab.optics.lens.pins import dimples, spots
from gellight.lab.simulator.scene import Press as Pressed
from gellight.lab.simulator.scene import Scene
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.training import fit, read_reference
from gellight.reconstruction.integration import angle_deg, normals
from gellight.reconstruction.lens.lens_file import FILE_NAME, read_record
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import Surface
from tests.helpers.distorted import TrueLens, map_error_px, pin_picture

PIXEL_MM, PIN_PIXEL_MM = 0.1176, 0.0588
SHAPE, SCENE_SHAPE = (240, 320), (300, 400)
INSIDE = np.s_[30:270, 40:360]
"""the undistorted view, in the larger scene"""
BALL = Ball(radius_mm=4.0, pixel_size_mm=PIXEL_MM)
PRESSES, ROUNDS = 30, 40
PLACES_MM = ((0, 0), (11, 7.5), (-11, 7.5), (11, -7.5), (-11, -7.5), (12, 0), (-12, 0), (0, 8))


class Bench:
    """The simulated gel behind the lens."""

    def __init__(self, k1: float, folder: Path) -> None:
        self.lens = TrueLens(k1=k1, centre_px=(163.0, 117.0), pixel_mm=(PIXEL_MM, PIXEL_MM), shape=SHAPE)
        # The host counts from the point of the gel that is seen in the middle of the picture.
        self.gel = self.lens.gel_of_pixels() - self.lens.to_gel(np.array([159.5, 119.5]))
        height, width = SCENE_SHAPE
        self._scene = Scene(
            SensorGeometry(image_width_px=width, image_height_px=height, pixel_size_mm=PIXEL_MM), CameraResponse()
        )
        self._places = (self.gel / PIXEL_MM + ((width - 1) / 2, (height - 1) / 2)).astype(np.float32)
        self._random = np.random.default_rng(0)
        self.folder = folder

    def shoot(self, press: Pressed | None, name: str) -> Surface:
        image, surface = self._scene.show(press)
        raw = cv2.remap(image, *cv2.split(self._places), cv2.INTER_CUBIC)
        cv2.imwrite(str(self.folder / name), digitise(raw, 1.0, self._random)[..., ::-1])
        return surface

    def press(self, name: str, x: float, y: float, depth: float) -> tuple[Press, Surface]:
        """Press the ball; the circle is that of the same area and centroid as the distorted contact."""
        surface = self.shoot(Pressed("BALL", depth, x, y), name)
        radius = np.sqrt(surface.contact.sum() / np.pi) * PIXEL_MM
        rows, columns = np.nonzero(((self.gel - (x, y)) ** 2).sum(axis=-1) < radius**2)
        return (
            Press(
                image=self.folder / name,
                center_x_px=float(columns.mean()),
                center_y_px=float(rows.mean()),
                contact_radius_px=float(np.sqrt(len(rows) / np.pi)),
            ),
            surface,
        )

    def trained(self) -> Bundle:
        (self.folder / "untouched").mkdir()
        for i in range(8):
            self.shoot(None, f"untouched/{i}.png")
        draw = self._random.uniform
        depths = self._random.choice([0.4, 0.8, 1.2, 1.8], PRESSES)
        presses = [
            self.press(f"press-{i}.png", draw(-12.5, 12.5), draw(-9, 9), float(depth))[0]
            for i, depth in enumerate(depths)
        ]
        untouched = read_reference(self.folder / "untouched")
        return fit(presses, untouched, BALL, self.folder / "bundle", sensor="bent")


def judged(felt: TactileFrame, surface: Surface, place: tuple[float, float]) -> list[float]:
    """Depth error in contact, um; of the peak, %; of normals, deg; out of round, %; misplaced, um."""
    contact, depth = surface.contact[INSIDE], surface.depth_mm[INSIDE]
    angle = angle_deg(felt.normal_map, normals(surface.gradient_map[INSIDE]))
    rows, columns = np.nonzero(felt.depth_mm > 0.4 * felt.depth_mm.max())
    small, large = np.sqrt(np.linalg.eigvalsh(np.cov(np.stack([columns, rows]))))
    centre = (np.array([columns.mean(), rows.mean()]) - (159.5, 119.5)) * PIXEL_MM
    return [
        1000 * float(np.abs(felt.depth_mm - depth)[contact].mean()),
        100 * float(felt.depth_mm.max() / depth.max() - 1),
        float(angle[contact].mean()),
        100 * (large / small - 1),
        1000 * float(np.linalg.norm(centre - place)),
    ]


def maps() -> None:
    """Print the map errors, px rms, of 20 random lenses from pictures of grids, and of 10 from pins in the gel."""
    errors: dict[str, list[float]] = {"spots": [], "dimples": []}
    gel = PressedGrid()
    for seed in range(100, 130):
        random = np.random.default_rng(seed)
        lens = TrueLens(
            k1=random.uniform(-0.08, 0.05),
            k2=random.uniform(-0.02, 0.02),
            centre_px=tuple(random.uniform([290, 215], [350, 265])),
        )
        kind, spacing = "spots" if seed < 120 else "dimples", spacing_px(lens.pixel_mm, 2.0)
        if kind == "spots":
            turn, shift = random.uniform(-45, 45), tuple(random.uniform(-1, 1, 2))
            picture = pin_picture(lens, noise=3.0, missing=0.1, angle_deg=turn, shift_mm=shift, seed=seed)
            contrasts = spots(picture.astype(np.float32), spacing)
        else:
            contrasts = dimples(gel.depth_mm(lens, random), spacing)
        lattice = read_pins(contrasts, pixel_size_mm=lens.pixel_mm, pitch_mm=2.0, source=f"seed {seed}")
        found = fit_lens([lattice], lens.shape, 2.0).lens
        rows, columns = np.indices(lens.shape)
        pixels = np.stack([columns, rows], axis=-1).astype(float)
        errors[kind].append(map_error_px(found.to_gel(pixels), lens.gel_of_pixels()))
    for kind, values in errors.items():
        print(f"{kind:10} median {np.median(values):.4f}, worst {max(values):.4f} px rms over the picture")


class PressedGrid:
    """Pins pressed into the simulated gel, seen through a lens and felt by the network of the undistorted sensor."""

    def __init__(self) -> None:
        wide = SensorGeometry(image_width_px=800, image_height_px=600, pixel_size_mm=PIN_PIXEL_MM)
        scene = Scene(wide, CameraResponse())
        self._untouched, self._pressed = (scene.show(press)[0] for press in (None, Pressed("PINS", 0.2, 0.3, -0.2)))

    def depth_mm(self, lens: TrueLens, random: np.random.Generator) -> np.ndarray:
        """(H, W) felt."""
        places = (lens.gel_of_pixels() / PIN_PIXEL_MM + (399.5, 299.5)).astype(np.float32)
        untouched, raw = (
            cv2.remap(one, *cv2.split(places), cv2.INTER_CUBIC) for one in (self._untouched, self._pressed)
        )
        picture = digitise(np.clip(raw, 0, 255), 1.0, random)
        bundle = load_bundle("synthetic").with_reference(np.clip(untouched, 0, 255), frames=30)
        return felt_depth_mm(Reconstructor(bundle), picture)


def main() -> None:
    if sys.argv[1:] == ["maps"]:
        maps()
        return
    k1 = float(sys.argv[1]) if len(sys.argv) > 1 else -0.05
    with tempfile.TemporaryDirectory() as name:
        bench = Bench(k1, Path(name))
        plain = bench.trained()
        grid = bench.folder / "grid.png"
        cv2.imwrite(str(grid), pin_picture(bench.lens, noise=2.0, pin_mm=0.4)[..., ::-1])
        measured = measure_lens(plain, [grid], 2.0)
        print(figures(measured, plain))
        lens = add_lens(plain, measured, [grid], bench.folder / "lens")
        naive = read_record(lens).model_copy(update={"learnt_from_circles": False})
        content = {FILE_NAME: naive.model_dump_json().encode()}
        ways = {
            "without lens": Reconstructor(plain),
            "with lens": Reconstructor(lens),
            "with lens, slopes as answered": Reconstructor(extend_bundle(lens, bench.folder / "naive", content)),
        }
        compare(bench, ways)


def compare(bench: Bench, ways: dict[str, Reconstructor]) -> None:
    """Print the errors of each way on fresh presses, and its time as a multiple of the first one's."""
    errors: dict[str, list[list[float]]] = {way: [] for way in ways}
    seconds: dict[str, list[float]] = {way: [] for way in ways}
    for i, (x, y) in enumerate(PLACES_MM):
        place = (x + 0.1, y - 0.2)
        press, surface = bench.press(f"fresh-{i}.png", *place, 1.0)
        image = np.ascontiguousarray(cv2.imread(str(press.image))[..., ::-1])
        frame = CameraFrame(image=image, time_s=0.0, sequence=i, source=press.image.name)
        for way, reconstructor in ways.items():
            errors[way].append(judged(reconstructor.reconstruct(frame), surface, place))
        for _ in range(ROUNDS):
            for way, reconstructor in ways.items():
                start = time.perf_counter()
                reconstructor.reconstruct(frame)
                seconds[way].append(time.perf_counter() - start)
    first = np.median(next(iter(seconds.values())))
    print(f"{'':40}{'depth um':>10}{'peak %':>8}{'deg':>7}{'round %':>9}{'place um':>10}{'time':>6}")
    for way, rows in errors.items():
        for where, part in (("middle", rows[:1]), ("border", rows[1:])):
            depth, peak, angle, out_of_round, misplaced = np.mean(part, axis=0)
            time_ratio = np.median(seconds[way]) / first
            print(
                f"{way + ', ' + where:40}{depth:>10.1f}{peak:>8.1f}{angle:>7.2f}{out_of_round:>9.1f}{misplaced:>10.0f}"
                f"{time_ratio:>6.2f}"
            )


if __name__ == "__main__":
    main()
