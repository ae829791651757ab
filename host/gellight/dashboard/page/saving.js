// What is shown, as files: the pictures as a PNG; what the server has at full size.

import { node } from "./dom.js";
import { fixed } from "./figures.js";

const CELL = { width: 480, height: 360, head: 30 };
const MARGIN = 16;

/** Offer a PNG of `pictures` [[title, canvas], ...] with the figures of `view`; `sensor` and `bundle` are their names. */
export function savePng(view, pictures, { sensor, bundle }) {
  const columns = 3;
  const rows = Math.ceil(pictures.length / columns);
  const step = { x: CELL.width + MARGIN, y: CELL.height + CELL.head + MARGIN };
  const canvas = node("canvas", "", "", { width: MARGIN + columns * step.x, height: 64 + rows * step.y });
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
  canvas.toBlob((blob) => download(blob, `gellight-${view.header.sequence}.png`), "image/png");
}

/** Draw `picture` into a cell, whole and undistorted. */
function contain(pen, picture, x, y) {
  const scale = Math.min(CELL.width / picture.width, CELL.height / picture.height);
  const [width, height] = [picture.width * scale, picture.height * scale];
  pen.drawImage(picture, x + (CELL.width - width) / 2, y + (CELL.height - height) / 2, width, height);
}

/** Save what the server has at `address`; return "" or why there is none, which a link alone would not say. */
export async function fetchFile(address) {
  try {
    const answer = await fetch(address);
    if (!answer.ok) return (await answer.json()).message;
    const name = answer.headers.get("Content-Disposition").match(/"(.*)"/)[1];
    download(await answer.blob(), name);
    return "";
  } catch {
    return "the sensor's program does not answer";
  }
}

function download(blob, name) {
  const link = node("a", "", "", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
