// Axes and curves on a canvas, in the colours of the page.

import { fit } from "./packed.js";

const MARGIN = { left: 40, right: 10, top: 8, bottom: 32 };
const FONT = "12px system-ui, sans-serif";
const PX_PER_TICK = { x: 70, y: 34 };

/**
 * Draw on `canvas` curves over axes. `x` and `y`: {from, to, label}. `curves`: [{points: [[x, y or null], ...], dashed,
 * filled}, ...]. `cursor`: an x that is marked. Returns a function from a px of the canvas to x.
 */
export function plot(canvas, { x, y, curves, cursor = null }) {
  const ratio = devicePixelRatio;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  fit(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const inner = { left: MARGIN.left, right: width - MARGIN.right, top: MARGIN.top, bottom: height - MARGIN.bottom };
  const at = {
    x: (value) => inner.left + ((value - x.from) / (x.to - x.from)) * (inner.right - inner.left),
    y: (value) => inner.bottom - ((value - y.from) / (y.to - y.from)) * (inner.bottom - inner.top),
  };
  const colours = getComputedStyle(canvas);
  const colour = (name) => colours.getPropertyValue(name);
  pen.fillStyle = colour("--well");
  pen.fillRect(inner.left, inner.top, inner.right - inner.left, inner.bottom - inner.top);
  axes(pen, { x, y, at, inner, ink: colour("--dim"), line: colour("--line") });
  pen.save();
  pen.beginPath();
  pen.rect(inner.left, inner.top, inner.right - inner.left, inner.bottom - inner.top);
  pen.clip();
  for (const curve of curves) draw(pen, curve, at, inner, colour(curve.dashed ? "--text" : "--accent"));
  if (cursor !== null) {
    pen.fillStyle = colour("--text");
    pen.fillRect(at.x(cursor) - 1, inner.top, 2, inner.bottom - inner.top);
  }
  pen.restore();
  return (px) => x.from + ((px - inner.left) / (inner.right - inner.left)) * (x.to - x.from);
}

function axes(pen, { x, y, at, inner, ink, line }) {
  pen.font = FONT;
  pen.lineWidth = 1;
  pen.strokeStyle = line;
  pen.fillStyle = ink;
  pen.beginPath();
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  const rows = ticks(y, (inner.bottom - inner.top) / PX_PER_TICK.y);
  for (const value of rows.values) {
    pen.moveTo(inner.left, at.y(value));
    pen.lineTo(inner.right, at.y(value));
    pen.fillText(value.toFixed(rows.digits), inner.left - 5, Math.max(at.y(value), 7));
  }
  pen.textBaseline = "alphabetic";
  const columns = ticks(x, (inner.right - inner.left) / PX_PER_TICK.x);
  for (const value of columns.values) {
    pen.moveTo(at.x(value), inner.top);
    pen.lineTo(at.x(value), inner.bottom);
    pen.textAlign = at.x(value) > inner.right - 16 ? "right" : "center";
    pen.fillText(value.toFixed(columns.digits), Math.min(at.x(value), inner.right), inner.bottom + 14);
  }
  pen.stroke();
  pen.textAlign = "left";
  pen.fillText(`${y.label} ↑`, 0, inner.bottom + 28);
  pen.textAlign = "right";
  pen.fillText(`${x.label} →`, inner.right, inner.bottom + 28);
}

function draw(pen, { points, dashed = false, filled = false }, at, inner, ink) {
  const path = new Path2D();
  let down = false;
  for (const [x, y] of points) {
    if (y === null) down = false;
    else {
      if (down) path.lineTo(at.x(x), at.y(y));
      else path.moveTo(at.x(x), at.y(y));
      down = true;
    }
  }
  pen.strokeStyle = ink;
  pen.lineWidth = dashed ? 1.3 : 2;
  pen.setLineDash(dashed ? [5, 4] : []);
  pen.stroke(path);
  pen.setLineDash([]);
  if (!filled || !down) return;
  path.lineTo(at.x(points.at(-1)[0]), inner.bottom);
  path.lineTo(at.x(points[0][0]), inner.bottom);
  pen.globalAlpha = 0.15;
  pen.fillStyle = ink;
  pen.fill(path);
  pen.globalAlpha = 1;
}

/** Round values within an axis, at most `most` steps apart; and the digits they need. */
function ticks({ from, to }, most) {
  const step = roundUp((to - from) / Math.max(most, 1));
  const first = Math.ceil(from / step - 1e-9);
  const count = Math.floor(to / step + 1e-9) - first + 1;
  const digits = Math.max(-Math.floor(Math.log10(step) + 1e-9), 0);
  return { values: Array.from({ length: count }, (_, i) => (first + i) * step), digits };
}

/** Round up to 1, 2 or 5 times a power of ten. */
export function roundUp(value) {
  const ten = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((times) => times * ten).find((size) => size >= value * 0.999);
}
