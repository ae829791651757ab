// The surface as a PLY file for other programs: mm, x to the right, y up, z towards the camera.

import { sizeMm } from "./field.js";
import { NO_DEPTH, depthMm } from "./packed.js";

const VERTEX_BYTES = 24;
const FACE_BYTES = 13;

/** Return the bytes of the surface of `view`: a vertex with its normal for each pixel that has a depth, and triangles. */
export function ply(view) {
  const places = new Int32Array(view.width * view.height).fill(-1); // number of the vertex of a pixel
  let count = 0;
  for (let i = 0; i < places.length; i++) if (view.depth[i] !== NO_DEPTH) places[i] = count++;
  const faces = triangles(places, view.width, view.height);
  return new Blob([head(view, count, faces.length), vertices(view, places, count), faceBytes(faces)], { type: "model/ply" });
}

function head({ header }, vertexCount, faceCount) {
  const properties = ["x", "y", "z", "nx", "ny", "nz"].map((name) => `property float ${name}`);
  return [
    "ply", "format binary_little_endian 1.0", `comment frame ${header.sequence} of ${header.source.replace(/\s+/g, " ")}`,
    "comment mm, x right, y up, z towards the camera, 0 where the gel is at rest",
    `element vertex ${vertexCount}`, ...properties,
    `element face ${faceCount}`, "property list uchar int vertex_indices", "end_header", "",
  ].join("\n");
}

function vertices(view, places, count) {
  const data = new DataView(new ArrayBuffer(count * VERTEX_BYTES));
  const [width, height] = sizeMm(view.header);
  for (let i = 0; i < places.length; i++) {
    if (places[i] < 0) continue;
    const [column, row] = [i % view.width, Math.floor(i / view.width)];
    const [slopeX, slopeY] = [view.slopes[2 * i], view.slopes[2 * i + 1]];
    const scale = 1 / Math.hypot(slopeX, slopeY, 1);
    const place = [((column + 0.5) / view.width - 0.5) * width, (0.5 - (row + 0.5) / view.height) * height, depthMm(view.depth[i])];
    const normal = [-slopeX * scale, slopeY * scale, scale]; // y is turned over
    [...place, ...normal].forEach((value, field) => data.setFloat32(places[i] * VERTEX_BYTES + 4 * field, value, true));
  }
  return data.buffer;
}

/** Two triangles for each four neighbours that all have a depth, anticlockwise as seen from the camera. */
function triangles(places, width, height) {
  const found = [];
  for (let row = 0; row < height - 1; row++) {
    for (let column = 0; column < width - 1; column++) {
      const i = row * width + column;
      const [a, b, c, d] = [places[i], places[i + 1], places[i + width], places[i + width + 1]];
      if (Math.min(a, b, c, d) >= 0) found.push([a, c, b], [b, c, d]);
    }
  }
  return found;
}

function faceBytes(faces) {
  const data = new DataView(new ArrayBuffer(faces.length * FACE_BYTES));
  faces.forEach((corners, face) => {
    data.setUint8(face * FACE_BYTES, corners.length);
    corners.forEach((corner, k) => data.setInt32(face * FACE_BYTES + 1 + 4 * k, corner, true));
  });
  return data.buffer;
}
