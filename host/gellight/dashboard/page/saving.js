// What is shown, as files: the pictures as a PNG, the data as an .npz, the surface as a PLY.

import { sizeMm } from "./field.js";
import { fixed } from "./figures.js";
import { NO_DEPTH, depthMm } from "./packed.js";
import { npz } from "./npz.js";
import { ply } from "./ply.js";

const CELL = { width: 480, height: 360, head: 30 };
const MARGIN = 16;

/** Offer the NumPy arrays of `view` for download; `image` is its camera image as ImageData. */
export function saveNpz(view, image) {
  offer(npz(arraysOf(view, image)), view, "npz");
}

export function savePly(view) {
  offer(ply(view), view, "ply");
}

function arraysOf(view, image) {
  const { width, height, header } = view;
  const [widthMm, heightMm] = sizeMm(header);
  const axis = (count, size) => Float32Array.from({ length: count }, (_, i) => ((i + 0.5) / count - 0.5) * size);
  const number = (value) => ({ data: Float64Array.of(value), shape: [] });
  const map = (codes) => ({ data: Float32Array.from(codes, (code) => (code === NO_DEPTH ? NaN : depthMm(code))), shape: [height, width] });
  return {
    depth_mm: map(view.depth),
    ...(view.truth ? { true_depth_mm: map(view.truth) } : {}),
    gradient_map: { data: view.slopes, shape: [height, width, 2] },
    contact: { data: Uint8Array.from({ length: width * height }, (_, i) => (view.contact[i >> 3] >> (7 - (i & 7))) & 1), shape: [height, width], kind: "|b1" },
    image: { data: Uint8Array.from(image.data.filter((_, i) => i % 4 !== 3)), shape: [height, width, 3] },
    x_mm: { data: axis(width, widthMm), shape: [width] },
    y_mm: { data: axis(height, heightMm), shape: [height] },
    sequence: { data: Int32Array.of(header.sequence), shape: [] },
    time_s: number(header.time_s),
    indentation_mm: number(header.contact.indentation_mm ?? NaN),
    area_mm2: number(header.contact.area_mm2 ?? NaN),
  };
}

/** Offer a PNG of `pictures` [[title, canvas], ...] with the figures of `view`; `sensor` and `bundle` are their names. */
export function savePng(view, pictures, { sensor, bundle }) {
  const columns = 3;
  const rows = Math.ceil(pictures.length / columns);
  const step = { x: CELL.width + MARGIN, y: CELL.height + CELL.head + MARGIN };
  const canvas = Object.assign(document.createElement("canvas"), { width: MARGIN + columns * step.x, height: 64 + rows * step.y });
  const pen = canvas.getContext("2d");
  const style = getComputedStyle(document.body);
  pen.fillStyle = style.getPropertyValue("--well");
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.fillStyle = style.getPropertyValue("--text");
  pen.font = "600 20px system-ui, sans-serif";
  const { indentation_mm: indentation, area_mm2: area } = view.header.contact;
  pen.fillText(`indentation ${fixed(indentation, 3)} mm, area ${fixed(area, 1)} mm²`, MARGIN, 30);
  pen.font = "14px system-ui, sans-serif";
  pen.fillText(`GelLight · ${sensor} · ${bundle} · frame ${view.header.sequence}`, MARGIN, 52);
  pictures.forEach(([title, picture], i) => {
    const [x, y] = [MARGIN + (i % columns) * step.x, 64 + Math.floor(i / columns) * step.y];
    pen.fillText(title, x, y + 20);
    contain(pen, picture, x, y + CELL.head);
  });
  canvas.toBlob((blob) => offer(blob, view, "png"), "image/png");
}

/** Draw `picture` into a cell, whole and undistorted. */
function contain(pen, picture, x, y) {
  const scale = Math.min(CELL.width / picture.width, CELL.height / picture.height);
  const [width, height] = [picture.width * scale, picture.height * scale];
  pen.drawImage(picture, x + (CELL.width - width) / 2, y + (CELL.height - height) / 2, width, height);
}

function offer(blob, { header }, ending) {
  download(blob, `gellight-${header.sequence}.${ending}`);
}

export function download(blob, name) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
