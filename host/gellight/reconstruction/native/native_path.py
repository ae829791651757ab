"""Camera frame to tactile frame on the C library; what it computes is what `numpy_path.NumpyPath` computes.

An unusual network stays in ONNX Runtime, rows of an unusual length in SciPy. The NumPy stage takes the lens out.
"""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, Contact, Patch, TactileFrame
from gellight.frames.pixel_grid import bounding_box, spread_blocks
from gellight.reconstruction.cast_shadows import CastShadows
from gellight.reconstruction.contact import (
    SMALLEST_PATCH_PX,
    THRESHOLD_MM,
    on_gel,
    patched,
    patches_of,
    without_untouched,
)
from gellight.reconstruction.gelnet import BLOCK_ROWS, CELL_PX, GradientNetwork
from gellight.reconstruction.integration import (
    cosines,
    far_cells,
    far_from_touch,
    from_cosines,
    level_of_sample,
    rest_level,
    sample_grid,
)
from gellight.reconstruction.lens.undistortion import Undistortion
from gellight.reconstruction.light_drift import difference_of
from gellight.reconstruction.native.cells import BLOCK_CELLS, NEAREST_GREY, CellAnswers, CellLimits
from gellight.reconstruction.native.library import Library, NativePathError
from gellight.reconstruction.native.native_shadows import NativeShadows
from gellight.reconstruction.native.network import fastest
from gellight.reconstruction.native.work import ArrayPool, WorkMemory
from gellight.reconstruction.perspective import Perspective
from gellight.reconstruction.rest_plane import RestPlane, tilt
from gellight.reconstruction.smoothing import FilterTaps
from gellight.reconstruction.stages import STAGES, FlatMaps, NetworkRows, Stages

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]

SMALLEST_PX = 32
"""Images smaller than this along one side are left to NumPy."""


class NativePath:
    """From a camera frame to a tactile frame; keeps working memory, so it serves one thread."""

    def __init__(
        self,
        library: Library,
        bundle: Bundle,
        network: GradientNetwork,
        undistortion: Undistortion | None,
        shadows: CastShadows | None,
        *,
        smoothing_px: int,
    ) -> None:
        """Take the parts; see `pipeline.Reconstructor`.

        Raises NativePathError for images smaller than `SMALLEST_PX`.
        """
        if min(bundle.image_shape) < SMALLEST_PX:
            raise NativePathError(f"images of {bundle.image_shape} px are too small for it")
        cells = CellAnswers(network)
        self._c, self._bundle, self._network, self._cells = library, bundle, network, cells
        self._undistortion = undistortion
        bulge = bundle.manifest.bulge
        self._answers = fastest(library, bundle.network, network.session, bundle.image_shape)
        self._shadows = shadows and NativeShadows(library, shadows, self._answers, cells.zero, bulge)
        self._height, self._width = bundle.image_shape
        self._taps = FilterTaps.of(smoothing_px) if smoothing_px >= 2 else None
        kept_rows = library.call("kept_rows", self._taps.reach) if self._taps else 0
        self._m = WorkMemory(bundle.image_shape, self._taps, kept_rows)
        self._m.coarse_rows[:, 3:] = self._network.coarse_position
        self._m.cell_rows[:, 3:] = cells.middle
        shape = bundle.image_shape
        self._differences, self._gradients, self._depths = map(ArrayPool, ((*shape, 3), (*shape, 2), shape))
        self._masks = ArrayPool(shape, np.bool_)
        self._reference = np.ascontiguousarray(bundle.reference, np.float32)
        self._limits = np.array(self._network.limits_grey, np.float32)
        self.limits = CellLimits.at_cells(network)
        self._perspective = Perspective.of_bundle(bundle)
        self._plane = RestPlane() if bundle.manifest.level_plane else None
        self.network_rows = NetworkRows()
        self._flat = FlatMaps(bundle.image_shape, stages=STAGES if undistortion is None else (*STAGES, "lens"))

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Return the maps and the contact of a frame of the bundle's size."""
        stages = Stages()
        difference = self._difference(camera_frame.image)
        stages.end("difference")
        touched = self._touched()
        self.network_rows = NetworkRows()
        stages.end("mask")
        if not touched:
            return self._flat.frame(camera_frame, difference, stages)
        self._slopes(difference, touched)
        far = far_cells(~self._m.touched[1::2, 1::2].view(np.bool_))
        if self._shadows:
            self._shadows.add_change(self._m, far, self.limits.grey)
        self._prefilter()
        stages.end("gradient")
        touched_pixels = self._without_lens()
        if touched_pixels is not None:
            stages.end("lens")
        if seen := self._perspective:
            self._run("slopes_by_view", self._m.measured, seen.x, seen.y, 1.0)
        depth_mm = self._depth(touched_pixels, far, camera_frame.time_s)
        stages.end("depth")
        self._smooth_adaptively(self._m.touched if touched_pixels is None else touched_pixels)
        if seen:
            self._run("depth_by_view", depth_mm, 1 / float(seen.height_mm))
            self._run("slopes_by_view", self._m.surface, seen.x, seen.y, -1.0)
        gradient_map = self._gradient_map(depth_mm)
        stages.end("normals")
        contact, contacts = self._felt(self._contact(depth_mm), depth_mm, gradient_map, touched_pixels)
        stages.end("contact")
        return TactileFrame(
            camera_frame=camera_frame,
            difference=difference,
            gradient_map=gradient_map,
            depth_mm=depth_mm,
            contact=contact,
            contacts=tuple(contacts),
            stage_seconds=stages.seconds,
        )

    def _difference(self, image: NDArray[np.uint8]) -> Floats:
        m, image, reference = self._m, np.ascontiguousarray(image), self._reference
        if self._bundle.manifest.follow_light:
            reference = image - difference_of(image, reference, follow_light=True)
        difference = self._differences.take()
        self._run("difference_and_means", image, reference, m.shift, difference, m.means, m.work)
        return difference

    def _touched(self) -> int:
        """How many cells are touched; which, is in `touched` of the work memory."""
        m = self._m
        clear, significant = (
            partial(self._run, "touched_cells", m.means, limits, m.touched, m.near, m.work, m.bytes)
            for limits in self._limits
        )
        return clear() or significant()

    def _slopes(self, difference: Floats, touched: int) -> None:
        m = self._m
        self._run("mean_rows", m.means, m.cell_rows, m.coarse_rows)
        coarse = self._coarse() if touched < m.touched.size else 0
        near = self._at_cells()
        given = (difference, m.touched, touched, m.planes, m.doubts, m.coarse, self.limits.noise_grey)
        single = self._run("blend", *given, m.slopes, m.index, m.work, m.bytes)
        self.network_rows = NetworkRows(coarse=coarse, cells=near, pixels=single)
        for start in range(0, single, BLOCK_ROWS):
            count = min(BLOCK_ROWS, single - start)
            at, rows = m.index[start:], m.rows[:count]
            self._c.call("pixel_rows", difference, at, rows, count, self._width)
            self._run("store_pixels", at, self._answers.slopes(rows), self._network.zero, m.slopes, count)

    def _coarse(self) -> int:
        """The slopes of the blocks, for where nothing touches; returns of how many the network was asked."""
        m, at_rest = self._m, self._cells.at_rest
        count = self._run("coarse_slopes", m.coarse_rows, at_rest, m.touched, self.limits.grey, m.coarse, m.around)
        if count:
            self._c.call("chosen_rows", m.coarse_rows, m.around, m.index, m.rows, len(m.coarse))
            at = m.index[:count]
            m.coarse[at] = self._answers.slopes(m.rows[:count]) - self._network.coarse_zero[at]
        return count

    def _at_cells(self) -> int:
        """The planes of the cells near a touch; returns of how many cells and blocks the network was asked."""
        m, asked = self._m, 0
        given = (m.cell_rows, m.coarse_rows, m.near, self.limits.grey)
        if self._run("split_cells", *given, m.high_contrast, m.low_contrast, m.around):
            asked = self._asked(m.coarse_rows, m.around, self._network.coarse_zero, m.coarse_planes)
            self._run("cells_from_blocks", m.coarse_planes, m.cell_rows, m.low_contrast, m.planes, m.work)
        asked += self._asked(m.cell_rows, m.high_contrast, self._cells.zero, m.planes)
        doubt_limits = np.array([NEAREST_GREY, self.limits.bend, self.limits.misfit], np.float32)
        self._run("cell_doubts", m.planes, m.near, doubt_limits, m.doubts, m.work_plane)
        return asked

    def _asked(self, rows: Floats, chosen: NDArray[np.uint8], zero: Floats, planes: Floats) -> int:
        """The network and its Jacobian at the chosen rows, into planes; returns how many rows."""
        m = self._m
        count = self._c.call("chosen_rows", rows, chosen, m.index, m.rows, chosen.size)
        for start in range(0, count, BLOCK_CELLS):
            block = m.rows[start : min(start + BLOCK_CELLS, count)]
            slopes, jacobian = self._answers.slopes_and_jacobian(block)
            answer = (m.index[start:], block, slopes, jacobian, zero, planes)
            self._c.call("store_cells", *answer, len(block), chosen.size)
        return count

    def _prefilter(self) -> None:
        m, taps = self._m, self._taps
        if taps is None:
            m.measured[:] = m.slopes
            return
        share, reach = float(1 - taps.narrowest[0] ** 2), len(taps.narrowest) - 1
        self._run("prefilter", m.slopes, m.measured, taps.narrowest, reach, share, m.noise, m.energy, m.work)

    def _without_lens(self) -> Bools | None:
        """Take the lens out of the measured slopes; return the touched pixels, None where there is no lens."""
        if self._undistortion is None:
            return None
        m = self._m
        slopes, touched = self._undistortion.apply(np.ascontiguousarray(np.moveaxis(m.measured, 0, 2)), self._pixels())
        m.measured[:] = np.moveaxis(slopes, 2, 0)
        return touched

    def _pixels(self) -> Bools:
        """The pixels that are touched, before the lens is taken out."""
        return spread_blocks(self._m.touched.view(np.bool_), CELL_PX, self._bundle.image_shape)

    def _depth(self, touched_pixels: Bools | None, far: Bools, time_s: float) -> Floats:
        """Integrate the measured slopes; also differentiate the depth into `surface` of the work memory."""
        m, size, bulge = self._m, self._bundle.pixel_size_mm, self._bundle.manifest.bulge
        depth = self._depths.take()
        self._run("divergence", m.measured, depth, *size, m.work)
        waves = cosines(depth)
        self._run("solve_columns", waves, m.factors, m.column)
        depth = from_cosines(waves)
        if self._plane:
            touched = self._pixels() if touched_pixels is None else touched_pixels
            plane = self._plane.following(depth, touched, time_s)
            m.measured -= np.asarray(plane / size, np.float32)[:, None, None]
            depth -= tilt(plane, depth.shape)
        if touched_pixels is None:
            level = level_of_sample(depth, self._resting(depth, far), bulge)
        else:
            level = rest_level(depth, far_from_touch(touched_pixels), bulge)
        if not np.isfinite(level):
            raise ValueError("the gradient map has values that are NaN or infinite")
        self._run("level_and_slopes", depth, float(level), m.surface, *size, m.work)
        return depth

    def _resting(self, depth: Floats, far: Bools) -> Floats:
        """The depths at rest among those on the sample grid."""
        m = self._m
        everywhere = far if far.any() else np.ones_like(far)
        step = sample_grid(depth.shape)[0].step
        count = self._run("resting_depths", depth, m.touched, everywhere, *everywhere.shape[::-1], step, m.work_plane)
        return m.work_plane[:count]

    def _smooth_adaptively(self, touched: NDArray[Any]) -> None:
        """Smooth the slopes of the surface as far as they allow; touched: (h, w) cells, or (H, W) pixels."""
        m, taps = self._m, self._taps
        side = CELL_PX if touched.shape == m.touched.shape else 1
        rows, columns = bounding_box(touched.view(np.bool_))
        if taps is None or not rows.stop:
            return
        top, left = (span.start * side // CELL_PX * CELL_PX for span in (rows, columns))
        bottom, right = min(rows.stop * side, self._height), min(columns.stop * side, self._width)
        slopes, filters = (m.surface, m.measured, m.noise), (taps.wider, taps.reach, taps.energies)
        box = (left, top, right, bottom)
        self._run("smooth_adaptively", *slopes, *filters, m.small, m.changes, m.work, m.flags, *box)

    def _gradient_map(self, depth_mm: Floats) -> Floats:
        m = self._m
        if self._undistortion is not None:
            depth_mm[~self._undistortion.seen], m.surface[:, ~self._undistortion.seen] = 0, 0
        gradient_map = self._gradients.take()
        self._run("gradient_map", m.surface, gradient_map)
        return gradient_map

    def _contact(self, depth_mm: Floats) -> Contact:
        m, (size_x, size_y) = self._m, self._bundle.pixel_size_mm
        mask = self._masks.take()
        self._run(
            "find_contact", depth_mm, THRESHOLD_MM, size_x / size_y, mask, m.found, m.blocks, m.label, m.parent,
            m.deepest, m.slot, m.histogram, m.work,
        )  # fmt: skip
        count, deepest, x, y = m.found.tolist()
        centroid = (x / count - (self._width - 1) / 2, y / count - (self._height - 1) / 2) if count else None
        return Contact(
            mask=mask,
            area_mm2=count * size_x * size_y,
            indentation_mm=deepest,
            centroid_mm=centroid and (centroid[0] * size_x, centroid[1] * size_y),
        )

    def _felt(
        self, contact: Contact, depth_mm: Floats, gradient_map: Floats, touched: Bools | None
    ) -> tuple[Contact, list[Patch]]:
        """Return the contact without what nothing touches, and its parts; touched: pixels, if the lens moved them."""
        m, pixel_size = self._m, self._bundle.pixel_size_mm
        if touched is None:
            maps, seen = (contact.mask, m.touched, depth_mm, m.surface), self._perspective
            view = (seen.x, seen.y, 1 / float(seen.height_mm)) if seen else (m.work, m.work, 0.0)
            count = self._run("measure_parts", *maps, *view, SMALLEST_PATCH_PX, m.runs, m.parts)
            if count >= 0:
                patches = patches_of(m.parts[:count], contact.mask.shape, pixel_size)
                return on_gel(contact, patches) if seen else contact, patches
            touched = self._pixels()
        contact = without_untouched(contact, touched, depth_mm, pixel_size)
        return patched(contact, depth_mm, gradient_map, pixel_size, self._perspective)

    def _run(self, function: str, *arguments: NDArray[Any] | float) -> int:
        """Call a function of the library with arrays and numbers, then width and height."""
        return self._c.call(function, *arguments, self._width, self._height)
