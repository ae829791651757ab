// Planes as they travel: raw deflate, and depth as differences of neighbours; view.py on the server packs them.

export const DEPTH_UNIT_MM = 5e-4;
export const DEPTH_OFFSET_MM = 1;
export const NO_DEPTH = 65535;

/** Depth in mm of a code of a depth map. */
export function depthMm(code) {
  return code * DEPTH_UNIT_MM - DEPTH_OFFSET_MM;
}

/** Undo raw deflate: a promise of the bytes. */
export async function inflate(bytes) {
  const { readable, writable } = new DecompressionStream("deflate-raw"); // a Blob of the bytes would cost ten times as much
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
