// Colours of depth: a fixed scale in micrometres, never stretched to what one frame happens to hold.

import { NO_DEPTH, depthMm } from "./packed.js";

export const DEPTH_SCALES_UM = [100, 200, 400, 800, 1200, 1600, 2000];

// Dark to light, so that deeper always looks brighter, also in grey.
const STOPS = [
  [31, 38, 66], [42, 54, 112], [52, 84, 158], [44, 126, 178], [44, 166, 166],
  [88, 200, 130], [168, 222, 98], [238, 230, 116], [255, 250, 218],
];
const ABOVE_SCALE = [255, 92, 160];
const NOTHING = [60, 60, 60];

const pack = ([r, g, b]) => (255 << 24) | (b << 16) | (g << 8) | r;

/** RGB of a place between 0 (rest) and 1 (end of the scale); what is above the end is pink. */
export function depthColour(fraction) {
  if (fraction > 1) return ABOVE_SCALE;
  const place = Math.max(fraction, 0) * (STOPS.length - 1);
  const stop = Math.min(Math.floor(place), STOPS.length - 2);
  return STOPS[stop].map((low, channel) => Math.round(low + (STOPS[stop + 1][channel] - low) * (place - stop)));
}

/** Packed RGBA of every depth code, for a scale that ends at `scaleUm`. */
export function depthTable(scaleUm) {
  const table = new Uint32Array(NO_DEPTH + 1);
  for (let code = 0; code < NO_DEPTH; code++) table[code] = pack(depthColour((depthMm(code) * 1000) / scaleUm));
  table[NO_DEPTH] = pack(NOTHING);
  return table;
}

/** Grey level to show for each coded difference, `gain` times as strong, around mid-grey. */
export function differenceTable(gain) {
  return Uint8ClampedArray.from({ length: 256 }, (_, code) => 128 + gain * (code - 128));
}
