// Depth and slope at any place of a view, in mm from the middle of the picture: x to the right, y down.

import { clamp } from "./hand.js";
import { NO_DEPTH, depthMm } from "./packed.js";

/** Size of the view on the gel, [width, height] in mm. */
export function sizeMm({ image_px: image, pixel_size_mm: pixel }) {
  return [image[0] * pixel[0], image[1] * pixel[1]];
}

/** Size of a pixel of a view on the gel, [x, y] in mm. */
export function pitchMm({ header, width, height }) {
  const [widthMm, heightMm] = sizeMm(header);
  return [widthMm / width, heightMm / height];
}

/** Return the depth in mm of `codes` (view.depth or view.truth) at a place; null outside and where there is none. */
export function depthAt(view, codes, place) {
  const [column, row] = pixelAt(view, place);
  const [left, top] = [clamp(Math.floor(column), 0, view.width - 2), clamp(Math.floor(row), 0, view.height - 2)];
  if (Math.abs(column - left - 0.5) > 1 || Math.abs(row - top - 0.5) > 1) return null;
  const [right, down] = [column - left, row - top];
  const first = top * view.width + left;
  const corners = [first, first + 1, first + view.width, first + view.width + 1].map((i) => codes[i]);
  if (corners.includes(NO_DEPTH)) return null;
  const [a, b, c, d] = corners.map(depthMm);
  return (1 - down) * (a + right * (b - a)) + down * (c + right * (d - c));
}

/** Return the angle in degrees between the surface at a place and the gel at rest; null where it is not known. */
export function slopeDegAt(view, place) {
  const [pitchX, pitchY] = pitchMm(view);
  const slopes = [[pitchX, 0], [0, pitchY]].map(([dx, dy]) => {
    const at = (side) => depthAt(view, view.depth, [place[0] + side * dx, place[1] + side * dy]);
    const [before, after] = [at(-1), at(1)];
    return before === null || after === null ? null : (after - before) / (2 * (dx + dy));
  });
  return slopes.includes(null) ? null : (Math.atan(Math.hypot(...slopes)) * 180) / Math.PI;
}

/** Return `count` + 1 places at the same distances along the line from `start` to `end`. */
export function along([start, end], count) {
  return Array.from({ length: count + 1 }, (_, i) => start.map((mm, axis) => mm + (i / count) * (end[axis] - mm)));
}

/**
 * Return the section of `codes` along a line: [[distance from its start in mm, depth in mm], ...], about one point a
 * pixel; a depth is null where there is none.
 */
export function sectionOf(view, codes, [start, end]) {
  const length = Math.hypot(end[0] - start[0], end[1] - start[1]);
  const count = Math.max(Math.ceil((length / sizeMm(view.header)[0]) * view.width), 1);
  return along([start, end], count).map((place, i) => [(i / count) * length, depthAt(view, codes, place)]);
}

/** Column and row of a place, in pixels from the middle of the first pixel. */
function pixelAt(view, [x, y]) {
  const [width, height] = sizeMm(view.header);
  return [(x / width + 0.5) * view.width - 0.5, (y / height + 0.5) * view.height - 0.5];
}
