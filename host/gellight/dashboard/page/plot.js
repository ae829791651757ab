// Axes and curves in an svg element; the colours are the style sheet's.

import { nothing, render, svg } from "./dom.js";

const MARGIN = { left: 40, right: 10, top: 8, bottom: 32 };
const PX_PER_TICK = { x: 70, y: 34 };

/**
 * Draw into `chart` curves over axes. `x` and `y`: {from, to, label}. `curves`: [{points: [[x, y or null], ...],
 * dashed, filled}, ...]. `cursor`: an x that is marked. Returns a function from a share of the chart's width to x.
 */
export function plot(chart, { x, y, curves, cursor = null }) {
  const { width, height } = chart.getBoundingClientRect();
  const { left, top } = MARGIN;
  const [across, up] = [Math.max(width - left - MARGIN.right, 1), Math.max(height - top - MARGIN.bottom, 1)];
  const [right, bottom] = [left + across, top + up];
  const atX = (value) => left + ((value - x.from) / (x.to - x.from)) * across;
  const atY = (value) => bottom - ((value - y.from) / (y.to - y.from)) * up;
  const row = ([value, text]) => svg`<path class="grid" d="M${left} ${atY(value)}H${right}"></path>
    <text x=${left - 5} y=${Math.max(atY(value), 7) + 4} text-anchor="end">${text}</text>`;
  const column = ([value, text]) => svg`<path class="grid" d="M${atX(value)} ${top}V${bottom}"></path>
    <text x=${atX(value)} y=${bottom + 14} text-anchor=${atX(value) > right - 16 ? "end" : "middle"}>${text}</text>`;
  render(svg`<rect class="well" x=${left} y=${top} width=${across} height=${up}></rect>
    ${ticks(y, up / PX_PER_TICK.y).map(row)}${ticks(x, across / PX_PER_TICK.x).map(column)}
    <text y=${bottom + 28}>${y.label} ↑</text><text x=${right} y=${bottom + 28} text-anchor="end">${x.label} →</text>
    <svg x=${left} y=${top} width=${across} height=${up} viewBox="${left} ${top} ${across} ${up}">
      ${curves.map((one) => curve(one, atX, atY, bottom))}
      ${cursor === null ? nothing : svg`<path class="cursor" d="M${atX(cursor)} ${top}V${bottom}"></path>`}
    </svg>`, chart);
  return (share) => x.from + ((share * width - left) / across) * (x.to - x.from);
}

function curve({ points, dashed, filled }, atX, atY, bottom) {
  const begins = (i) => i === 0 || points[i - 1][1] === null;
  const to = ([x, y], i) => (y === null ? "" : `${begins(i) ? "M" : "L"}${atX(x)} ${atY(y)}`);
  const line = points.map(to).join("");
  const area = filled && line ? `${line}V${bottom}H${atX(points[0][0])}Z` : "";
  return svg`<path class="area" d=${area}></path><path class="curve ${dashed ? "dashed" : ""}" d=${line}></path>`;
}

/** Round values within an axis, at most `most` steps apart, each with how it is written. */
function ticks({ from, to }, most) {
  const step = roundUp((to - from) / Math.max(most, 1));
  const first = Math.ceil(from / step - 1e-9);
  const count = Math.floor(to / step + 1e-9) - first + 1;
  const digits = Math.max(-Math.floor(Math.log10(step) + 1e-9), 0);
  return Array.from({ length: count }, (_, i) => (first + i) * step).map((value) => [value, value.toFixed(digits)]);
}

/** Round up to 1, 2 or 5 times a power of ten. */
export function roundUp(value) {
  const ten = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((times) => times * ten).find((size) => size >= value * 0.999);
}
