// What is shown, as a PNG.

import { download } from "./command.js";
import { fixed } from "./figures.js";

const CELL = { width: 480, height: 360, head: 30 };
const MARGIN = 16;

/** Offer a PNG of `planes` {title: {canvas}, ...} with the figures of `view`; `maker` names sensor and bundle. */
export function savePng(view, planes, maker) {
  const pictures = Object.entries(planes);
  const columns = 3;
  const rows = Math.ceil(pictures.length / columns);
  const step = { x: CELL.width + MARGIN, y: CELL.height + CELL.head + MARGIN };
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width: MARGIN + columns * step.x, height: 64 + rows * step.y });
  const pen = canvas.getContext("2d");
  const { backgroundColor, color } = getComputedStyle(document.documentElement);
  pen.fillStyle = backgroundColor;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.fillStyle = color;
  pen.font = "600 20px system-ui, sans-serif";
  const { indentation_mm: indentation, area_mm2: area } = view.header.contact;
  pen.fillText(`indentation ${fixed(indentation, 3)} mm, area ${fixed(area, 1)} mm²`, MARGIN, 30);
  pen.font = "14px system-ui, sans-serif";
  pen.fillText(`GelLight · ${maker} · frame ${view.header.sequence}`, MARGIN, 52);
  pictures.forEach(([title, { canvas: picture }], i) => {
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
