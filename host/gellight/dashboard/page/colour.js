// Colours of depth: a fixed scale in micrometres, never stretched to what one frame happens to hold.

import { NO_DEPTH, depthMm } from "./packed.js";

// Dark to light, so that deeper always looks brighter, to every eye and in grey.
const MAPS = {
  ocean: "1f2642 2a3670 34549e 2c7eb2 2ca6a6 58c882 a8de62 eee674 fffada",
  viridis: "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725",
  cividis: "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838",
  grey: "202020 f0f0f0",
};
const levels = (hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16));
const stopsOf = (name) => MAPS[name].split(" ").map(levels);
let stops = stopsOf("ocean");

/** Choose one of `MAPS`; tables made before keep their colours. */
export function chooseMap(name) {
  stops = stopsOf(name);
}

const ABOVE_SCALE = [200, 0, 255]; // violet: unlike every colour of every map to every eye
const NOTHING = [60, 60, 60];

/** Return an opaque pixel of three levels from 0 to below 256, each cut to a whole number. */
export const rgb = (red, green, blue) => (255 << 24) | (blue << 16) | (green << 8) | red;

/** RGB of a place between 0 (rest) and 1 (end of the scale); what is above the end is violet. */
export function depthColour(fraction) {
  if (fraction > 1) return ABOVE_SCALE;
  const place = Math.max(fraction, 0) * (stops.length - 1);
  const stop = Math.min(Math.floor(place), stops.length - 2);
  return stops[stop].map((low, channel) => Math.round(low + (stops[stop + 1][channel] - low) * (place - stop)));
}

/** Packed RGBA of every depth code, for a scale that ends at `scaleUm`. */
export function depthTable(scaleUm) {
  const table = new Uint32Array(NO_DEPTH + 1);
  for (let code = 0; code < NO_DEPTH; code++) table[code] = rgb(...depthColour((depthMm(code) * 1000) / scaleUm));
  table[NO_DEPTH] = rgb(...NOTHING);
  return table;
}
