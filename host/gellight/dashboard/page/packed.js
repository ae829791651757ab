// Planes as they travel, and what the page computes of them instead of fetching it; view.py on the server packs them.

export const DEPTH_UNIT_MM = 5e-4;
export const DEPTH_OFFSET_MM = 1;
export const NO_DEPTH = 65535;
const MID_GREY = 128;

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

/** Return a promise of the pixels of a packed picture, as ImageData. */
export async function unpackPicture(blob) {
  const bitmap = await createImageBitmap(blob, { colorSpaceConversion: "none" });
  Object.assign(canvas, { width: bitmap.width, height: bitmap.height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
  return context.getImageData(0, 0, canvas.width, canvas.height);
}

/** Write image minus reference image minus the light's drift, `gain` times, around 128, into the RGBA of `pixels`. */
export function subtract({ image, reference, header }, gain, pixels) {
  const [from, rest] = [image.data, reference.picture.data];
  for (let i = 0; i < pixels.length; i += 4) {
    for (let channel = 0; channel < 3; channel++) {
      const difference = from[i + channel] - rest[i + channel] - header.light_drift[channel];
      pixels[i + channel] = MID_GREY + gain * difference;
    }
  }
}
