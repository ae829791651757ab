// What the page computes of a frame: slopes from the depth map.

import { DEPTH_UNIT_MM, NO_DEPTH } from "./message.js";

/** Return (h, w, 2) d(depth)/dx, d(depth)/dy by central differences, one-sided at the rims; 0 where a depth is missing. */
export function slopesOf(depth, width, height, [pitchX, pitchY]) {
  const slopes = new Float32Array(2 * width * height);
  for (let row = 0, i = 0; row < height; row++) {
    const [above, below] = [row > 0 ? width : 0, row < height - 1 ? width : 0];
    const rowsMm = ((above + below) / width) * pitchY;
    for (let column = 0; column < width; column++, i++) {
      const [left, right] = [column > 0 ? 1 : 0, column < width - 1 ? 1 : 0];
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

