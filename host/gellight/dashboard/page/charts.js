// The small drawings of the wizard: a curve, the map of places, the rose of slopes.

const SVG = "http://www.w3.org/2000/svg";
/** A colour of the page, in the mode (light or dark) in use. */
const ink = (name) => getComputedStyle(document.body).getPropertyValue(name);
const FULL = 3; // presses of a place that is drawn in full colour; one is enough

/** Draw points [[x, y], ...] as a curve from 0 up, or on a logarithmic scale; the last value stands at its end. */
export function drawCurve(canvas, points, { log = false } = {}) {
  const scale = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = width * scale;
  canvas.height = height * scale;
  const pen = canvas.getContext("2d");
  pen.scale(scale, scale);
  const shape = (y) => (log ? Math.log10(Math.max(y, 1e-6)) : y);
  const values = points.map(([, y]) => shape(y));
  const [low, high] = [log ? Math.min(...values) : 0, Math.max(...values)];
  const span = high - low || 1;
  const [first, last] = [points[0][0], points.at(-1)[0]];
  const left = 44, bottom = height - 18;
  const at = ([x, y]) => [left + ((x - first) / (last - first || 1)) * (width - left - 8), bottom - ((shape(y) - low) / span) * (bottom - 10)];
  axis(pen, { low, high, log, left, bottom, width, first, last });
  pen.strokeStyle = ink("--accent");
  pen.lineWidth = 2;
  pen.beginPath();
  for (const point of points) pen.lineTo(...at(point));
  pen.stroke();
  pen.fillStyle = ink("--accent");
  pen.beginPath();
  pen.arc(...at(points.at(-1)), 3, 0, 7);
  pen.fill();
}

function axis(pen, { low, high, log, left, bottom, width, first, last }) {
  const text = (value) => Number((log ? 10 ** value : value).toPrecision(2)).toString();
  pen.fillStyle = ink("--dim");
  pen.strokeStyle = ink("--line");
  pen.font = "12px system-ui, sans-serif";
  for (const [value, y] of [[high, 10], [low, bottom]]) {
    pen.textAlign = "right";
    pen.fillText(text(value), left - 6, y + 4);
    pen.beginPath();
    pen.moveTo(left, y);
    pen.lineTo(width - 8, y);
    pen.stroke();
  }
  pen.textAlign = "left";
  pen.fillText(String(first), left, bottom + 14);
  pen.textAlign = "right";
  pen.fillText(String(last), width - 8, bottom + 14);
}

/** Draw counts of presses, rows x columns, as cells from empty to enough. */
export function drawPlaces(svg, places) {
  const [rows, columns] = [places.length, places[0].length];
  svg.setAttribute("viewBox", `0 0 ${columns * 10} ${rows * 10}`);
  svg.replaceChildren(...places.flatMap((row, y) => row.flatMap((count, x) => {
    const cell = shape("rect", { x: x * 10 + 0.4, y: y * 10 + 0.4, width: 9.2, height: 9.2, rx: 1.4, fill: tint(count / FULL) });
    const label = shape("text", { x: x * 10 + 5, y: y * 10 + 6.8, "text-anchor": "middle", "font-size": 5.2, fill: count > 1 ? "#06201e" : "#ffffff" });
    label.textContent = count;
    return [cell, label];
  })));
}

/** Draw counts of pixels, directions x steepness, as sectors of a rose: gentle slopes inside, steep ones outside. */
export function drawSlopes(svg, slopes, steepnessDeg) {
  const most = Math.max(1, ...slopes.flat());
  const bands = slopes[0].length;
  const turn = (2 * Math.PI) / slopes.length;
  svg.replaceChildren(...slopes.flatMap((row, direction) => row.map((count, band) => {
    const sector = shape("path", { d: ring(direction * turn, turn, (band / bands) * 50, ((band + 1) / bands) * 50), fill: tint(Math.sqrt(count / most)), stroke: "#11161f", "stroke-width": 0.8 });
    const title = shape("title", {});
    title.textContent = `${steepnessDeg[band]} to ${steepnessDeg[band + 1]} degrees: ${count} pixels`;
    sector.append(title);
    return sector;
  })));
}

function ring(start, turn, inner, outer) {
  const at = (angle, radius) => `${(radius * Math.cos(angle)).toFixed(2)} ${(-radius * Math.sin(angle)).toFixed(2)}`;
  const end = start + turn;
  return `M${at(start, outer)}A${outer} ${outer} 0 0 0 ${at(end, outer)}L${at(end, inner)}A${inner} ${inner} 0 0 1 ${at(start, inner)}Z`;
}

function shape(kind, attributes) {
  const made = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

/** From the colour of nothing to that of enough. */
function tint(share) {
  const reached = Math.min(share, 1);
  if (reached === 0) return "#1a2130";
  const mix = (from, to) => Math.round(from + (to - from) * reached);
  return `rgb(${mix(26, 76)}, ${mix(72, 201)}, ${mix(78, 192)})`;
}
