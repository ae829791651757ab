// The binary message of one tactile frame; messages.py on the server describes every byte.

const MAGIC = 0x464c4547; // "GELF", little-endian
const VERSION = 1;
const PREFIX_BYTES = 12;

export const DEPTH_UNIT_MM = 1e-4;
export const DEPTH_OFFSET_MM = 1;
export const NO_DEPTH = 65535;

/** Depth in mm of a code of the depth plane. */
export function depthMm(code) {
  return code * DEPTH_UNIT_MM - DEPTH_OFFSET_MM;
}

/**
 * Return {header, width, height, image, difference, normal, depth, contact, truth}: typed arrays on `buffer`, no copies.
 * `truth` is the true depth map in the codes of `depth`; null where the sensor is not simulated.
 */
export function decode(buffer) {
  const prefix = new DataView(buffer);
  if (prefix.getUint32(0, true) !== MAGIC || prefix.getUint32(4, true) !== VERSION) {
    throw new Error("the server speaks another version: reload this page");
  }
  const start = PREFIX_BYTES + prefix.getUint32(8, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, PREFIX_BYTES, start - PREFIX_BYTES)));
  const place = Object.fromEntries(header.planes.map((plane) => [plane.name, plane]));
  const bytes = (name) => new Uint8Array(buffer, start + place[name].offset, place[name].length);
  const [width, height] = header.view_px;
  const depths = ({ offset, length }) => new Uint16Array(buffer, start + offset, length / 2);
  return {
    header,
    width,
    height,
    image: bytes("image"),
    difference: bytes("difference"),
    normal: new Int8Array(buffer, start + place.normal.offset, place.normal.length),
    depth: depths(place.depth),
    contact: bytes("contact"),
    truth: place.truth ? depths(place.truth) : null,
  };
}
