// What the page computes of a frame instead of fetching it: slopes from the depth map, the difference from the image.

import { DEPTH_UNIT_MM, NO_DEPTH } from "./packed.js";

const DIFFERENCE_OFFSET = 128;

/** Return (h, w, 2) d(depth)/dx, d(depth)/dy by central differences, one-sided at the rims; 0 where a depth is missing. */
export function slopesOf(depth, width, height, [pitchX, pitchY]) {
  const slopes = new Float32Array(2 * width * height);
  for (let row = 0, i = 0; row < height; row++) {
    const above = row > 0 ? width : 0;
    const below = row < height - 1 ? width : 0;
    const rowsMm = ((above + below) / width) * pitchY;
    for (let column = 0; column < width; column++, i++) {
      const left = column > 0 ? 1 : 0;
      const right = column < width - 1 ? 1 : 0;
      slopes[2 * i] = slope(depth[i - left], depth[i + right], (left + right) * pitchX);
      slopes[2 * i + 1] = slope(depth[i - above], depth[i + below], rowsMm);
    }
  }
  return slopes;
}

function slope(before, after, distanceMm) {
  if (before === NO_DEPTH || after === NO_DEPTH || distanceMm === 0) return 0;
  return ((after - before) * DEPTH_UNIT_MM) / distanceMm;
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
