// What the page computes of a frame instead of fetching it: slopes from the depth map, the difference from the image.

import { DEPTH_UNIT_MM, NO_DEPTH } from "./packed.js";

const DIFFERENCE_OFFSET = 128;

/** Return (h, w, 2) d(depth)/dx, d(depth)/dy by central differences, one-sided at the rims; 0 where a depth is missing. */
export function slopesOf(depth, width, height, [pitchX, pitchY]) {
  const slopes = new Float32Array(2 * width * height);
  for (let row = 0; row < height; row++) {
    const above = row > 0 ? width : 0;
    const below = row < height - 1 ? width : 0;
    const first = row * width;
    const along = DEPTH_UNIT_MM / (2 * pitchX);
    const across = DEPTH_UNIT_MM / (Math.max((above + below) / width, 1) * pitchY);
    fill(slopes, 0, depth, first + 1, first + width - 1, 1, 1, along);
    fill(slopes, 1, depth, first, first + width, above, below, across);
    if (width < 2) continue;
    fill(slopes, 0, depth, first, first + 1, 0, 1, 2 * along);
    fill(slopes, 0, depth, first + width - 1, first + width, 1, 0, 2 * along);
  }
  return slopes;
}

/** Fill one of the two slopes of pixels from `from` up to `to` from the neighbours `before` and `after` it. */
function fill(slopes, axis, depth, from, to, before, after, factor) {
  for (let i = from; i < to; i++) {
    const one = depth[i - before];
    const other = depth[i + after];
    if (one !== NO_DEPTH && other !== NO_DEPTH) slopes[2 * i + axis] = (other - one) * factor;
  }
}

let canvas = null;

/** Return the (h, w, 4) RGBA bytes of a picture. */
export function pixelsOf(bitmap) {
  canvas ??= new OffscreenCanvas(1, 1);
  if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) Object.assign(canvas, { width: bitmap.width, height: bitmap.height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(bitmap, 0, 0);
  return context.getImageData(0, 0, bitmap.width, bitmap.height).data;
}

/** Return (h, w, 3) bytes, grey levels + 128: (h, w, 4) image minus reference image minus the light's drift. */
export function differenceOf(image, reference, drift) {
  const difference = new Uint8ClampedArray((image.length / 4) * 3);
  const [red, green, blue] = drift.map((grey) => DIFFERENCE_OFFSET - grey);
  for (let from = 0, to = 0; from < image.length; from += 4, to += 3) {
    difference[to] = image[from] - reference[from] + red;
    difference[to + 1] = image[from + 1] - reference[from + 1] + green;
    difference[to + 2] = image[from + 2] - reference[from + 2] + blue;
  }
  return difference;
}
