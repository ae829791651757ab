// Planes as they travel, and what the page computes of them instead of fetching it; view.py on the server packs them.

export const DEPTH_UNIT_MM = 5e-4;
export const DEPTH_OFFSET_MM = 1;
export const NO_DEPTH = 65535;
const DIFFERENCE_OFFSET = 128;

/** Depth in mm of a code of a depth map. */
export function depthMm(code) {
  return code * DEPTH_UNIT_MM - DEPTH_OFFSET_MM;
}

/** Undo raw deflate: a promise of the bytes. */
export async function inflate(bytes) {
  const { readable, writable } = new DecompressionStream("deflate-raw"); // a Blob would cost ten times as much
  const writer = writable.getWriter();
  const written = Promise.all([writer.write(bytes), writer.close()]);
  const [inflated] = await Promise.all([new Response(readable).arrayBuffer(), written]);
  return new Uint8Array(inflated);
}

/** Return the (h, w) codes of a depth map from its inflated bytes: all low bytes, then all high bytes. */
export function unpackDepth(bytes, width, height) {
  const count = width * height;
  const codes = new Uint16Array(count);
  const columns = new Int32Array(width); // of this row, the differences from the codes to the left
  for (let row = 0, i = 0; row < height; row++) {
    let code = 0;
    for (let column = 0; column < width; column++, i++) {
      const small = bytes[i] | (bytes[i + count] << 8);
      columns[column] += (small >> 1) ^ -(small & 1);
      code += columns[column];
      codes[i] = code;
    }
  }
  return codes;
}

/** Return (h, w, 2) d(depth)/dx, d(depth)/dy by central differences, one-sided at the rims; 0 without a depth. */
export function slopesOf(depth, width, height, [pitchX, pitchY]) {
  const slopes = new Float32Array(2 * width * height);
  const slope = (from, to, mm) =>
    (depth[from] === NO_DEPTH || depth[to] === NO_DEPTH ? 0 : (depth[to] - depth[from]) * (DEPTH_UNIT_MM / mm));
  for (let row = 0, i = 0; row < height; row++) {
    const above = row > 0 ? 1 : 0;
    const below = row < height - 1 ? 1 : 0;
    const downMm = Math.max(above + below, 1) * pitchY;
    for (let column = 0; column < width; column++, i++) {
      const left = column > 0 ? 1 : 0;
      const right = column < width - 1 ? 1 : 0;
      slopes[2 * i] = slope(i - left, i + right, Math.max(left + right, 1) * pitchX);
      slopes[2 * i + 1] = slope(i - above * width, i + below * width, downMm);
    }
  }
  return slopes;
}

const canvas = new OffscreenCanvas(1, 1);

/** Give a canvas a size, which empties it; leave one alone that has it. */
export function fit(canvas, { width, height }) {
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
}

/** Return the (h, w, 4) RGBA bytes of a picture. */
export function pixelsOf(bitmap) {
  const { width, height } = bitmap;
  fit(canvas, bitmap);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(bitmap, 0, 0);
  return context.getImageData(0, 0, width, height).data;
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
