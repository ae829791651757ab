// The numbers of the page: of the contact, the light ring, and what the daemon says of itself.

import { html, nothing, svg } from "./dom.js";

const FORCE_FLAGS = { beyond_view: "and more beyond the view", heavier: "heavier than calibrated" };
const RING_RADIUS = 48;

/** `value` with `digits` digits, without a minus before zero; a dash where it is not known. */
export function fixed(value, digits) {
  if (typeof value !== "number") return "–";
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

/** The figures of the contact of one frame; a force only where the bundle has a constant for it or the gel has dots. */
export function contactFigures({ contact, force, shear }) {
  const centre = contact.centroid_mm?.map((mm) => fixed(mm, 2)).join(", ") ?? "–";
  return html`
    <div class="big"><dt>indentation</dt>
      <dd><span id="indentation" data-testid="indentation">${fixed(contact.indentation_mm, 3)}</span>
        <small>mm</small></dd></div>
    <div><dt>area</dt><dd><span data-testid="area">${fixed(contact.area_mm2, 1)}</span> <small>mm²</small></dd></div>
    <div><dt>centre</dt><dd><span data-testid="centroid">${centre}</span> <small>mm</small></dd></div>
    ${shear ? along(shear) : nothing}
    ${force ? html`<div data-testid="force-row" class=${force.flags.length ? "notice" : ""}
      title=${force.flags.map((flag) => FORCE_FLAGS[flag] ?? flag).join(", ")}><dt>force</dt><dd><span
        data-testid="force">${fixed(force.normal_n, 2)}</span> <small>${`±${fixed(force.error_n, 2)}`}</small>
        <small>N</small></dd></div>` : nothing}`;
}

/** The force along the gel. */
function along({ force_n: newtons, force_error_n: error, torque_nmm: torque, slip, unknown }) {
  return html`<div data-testid="shear-row" class=${newtons ? "" : "notice"}
    title=${newtons ? `torque ${fixed(torque, 2)} N mm` : unknown}>
    <dt title="the force along the gel, x and y">along</dt>
    <dd><span data-testid="shear">${newtons?.map((newton) => fixed(newton, 2)).join(", ") ?? "unknown"}</span>
      <small>${newtons ? `±${fixed(Math.max(...error), 2)}` : ""}</small> <small>N</small>
      <small data-testid="slip">${slip === "unknown" ? "" : slip}</small></dd></div>`;
}

/** The contacts of a frame; the sensor numbers them, and each keeps its number while it lasts. */
export function contactRows(contacts) {
  return contacts.map(({ number, depth_mm: depth, area_mm2: area, volume_mm3: volume, slope_rad: slope }) => html`<tr>
    <td>${number}</td><td>${fixed(depth, 3)}</td><td>${fixed(area, 2)}</td><td>${fixed(volume, 2)}</td>
    <td>${fixed(slope === null ? null : (slope * 180) / Math.PI, 1)}</td></tr>`);
}

/** The light ring as the camera saw it lit, [r, g, b] for each LED or null: LED 0 at +x, anticlockwise. */
export function lamps(light) {
  if (!light) return svg`<circle r=${RING_RADIUS} fill="none" stroke="currentColor" stroke-dasharray="3 5"></circle>
    <text text-anchor="middle" fill="currentColor" font-size="12">light unknown</text>`;
  const all = light.map((rgb, index) => {
    const angle = (2 * Math.PI * index) / light.length;
    return { rgb, index, cx: RING_RADIUS * Math.cos(angle), cy: -RING_RADIUS * Math.sin(angle) };
  });
  return svg`
    <defs><clipPath id="disc"><circle r="39"></circle></clipPath>${all.map(({ index, rgb }) => svg`
      <radialGradient id="glow-${index}"><stop offset="0.2" stop-color="rgb(${rgb})" stop-opacity="0.55"></stop>
        <stop offset="1" stop-color="rgb(${rgb})" stop-opacity="0"></stop></radialGradient>`)}</defs>
    <circle r="39" fill="#05070b"></circle>
    <g clip-path="url(#disc)">${all.map(({ index, cx, cy }) => svg`
      <circle cx=${cx} cy=${cy} r="66" fill="url(#glow-${index})"></circle>`)}</g>
    <circle r="39" fill="none" stroke="#2a3548"></circle>
    ${all.map(lamp)}`;
}

function lamp({ index, rgb, cx, cy }) {
  const [fill, stroke] = Math.max(...rgb) > 0 ? [`rgb(${rgb})`, "#8889"] : ["#141a26", "currentColor"];
  return svg`<circle cx=${cx} cy=${cy} r="6" fill=${fill} stroke=${stroke} data-testid="led-${index}">
    <title>LED ${index}: ${rgb.join(", ")}</title></circle>`;
}

/** What the daemon says of its frames and stages, and the page of its own. */
export function diagnostics(status, { drawnFps, behindMs, kept }) {
  const { frame_age_ms: age, stage_ms: stages = {}, dropped } = status ?? {};
  const longest = Math.max(1, ...Object.values(stages));
  const pair = (id, name, value, unit = "") => html`
    <div><dt>${name}</dt><dd><span data-testid=${id}>${value}</span> ${unit}</dd></div>`;
  return html`
    <section>
      <h3>Frames</h3>
      <dl class="pairs value">
        ${pair("drawn-fps", "drawn a second", fixed(drawnFps, 1))}
        ${pair("age-median", "age, median", fixed(age?.median, 1), "ms")}
        ${pair("age-p95", "age, 95 %", fixed(age?.p95, 1), "ms")}${pair("dropped", "dropped", dropped ?? "–")}
        ${pair("link-behind", "link behind", fixed(behindMs, 0), "ms")}${heat(status?.ring)}
        ${pair("kept", "kept to scrub", kept)}
      </dl>
    </section>
    <section>
      <h3>Stages <span class="dim">ms</span> <span class="dim" data-testid="mode">${modeOf(status ?? {})}</span></h3>
      <dl class="bars value" data-testid="stages">${Object.entries(stages).map(([name, ms]) => html`
        <div><dt>${name}</dt><meter min="0" max=${longest} value=${ms}></meter><dd>${fixed(ms, 1)}</dd></div>`)}</dl>
    </section>`;
}

/** How warm the light ring is; nothing where its board does not know. */
function heat(ring) {
  const known = [["ring_c", ""], ["chip_c", "chip "]].filter(([key]) => typeof ring?.[key] === "number");
  if (known.length === 0) return nothing;
  const degrees = known.map(([key, name]) => `${name}${fixed(ring[key], 0)} °C`).join(", ");
  const dimmed = ring.dimmed ? `, dimmed to 1/${2 ** ring.dimmed}` : "";
  return html`<div data-testid="heat-row" class=${dimmed ? "notice" : ""}>
    <dt title="degrees of the light ring, and of its board's chip">light ring</dt>
    <dd data-testid="heat">${degrees + dimmed}</dd></div>`;
}

/** How slopes are found, and what the last series of exposures said. */
function modeOf({ mode, exposures }) {
  if (mode !== "photometric") return "";
  return exposures ? `${mode}, ${exposures.exposures} exposures${exposures.moved ? ", scene moved" : ""}` : mode;
}

/** Which bundle is in service, and the error that fresh presses have shown. */
export function bundleText(calibration) {
  if (!calibration) return "–";
  const name = `${calibration.sensor} ${calibration.identity.slice(0, 6)}`;
  const { verified } = calibration;
  if (!verified) return `${name}, not verified`;
  // Without a truth the contact circle does not say how deep its rim lies, so only the shape of the dent is verified.
  const { true_depth_mm: trueMm, depth_mm: shapeMm, normal_deg: normalDeg } = verified;
  const [what, mm] = typeof trueMm === "number" ? ["depth", trueMm] : ["shape", shapeMm];
  return `${name}, ${what} ±${fixed(mm * 1000, 0)} µm, normals ±${fixed(normalDeg, 1)}°`;
}

/** The top of the page; `sensors`: [name, address] of those of this computer that have a page. */
export function header(status, state, sensors) {
  const [sensor, bundle] = [status?.sensor ?? "–", bundleText(status?.calibration)];
  const option = ([name, page]) => html`<option value=${page}
    .selected=${new URL(page).origin === location.origin}>${name}</option>`;
  return html`
    <img src="favicon.svg" alt="" width="26" height="26">
    <h1>GelLight</h1>
    <select class="sensors" data-testid="sensors" aria-label="sensor that is shown" ?hidden=${sensors.length < 2}
      @change=${({ target }) => { location.href = `${target.value}${location.hash}`; }}>${sensors.map(option)}</select>
    <dl class="identity">
      <div><dt>sensor</dt><dd id="sensor" class="mono" data-testid="sensor" title=${sensor}>${sensor}</dd></div>
      <div><dt>bundle</dt><dd id="bundle" data-testid="bundle" title=${bundle}>${bundle}</dd></div>
    </dl>
    <p class="rate value"><span data-testid="fps">${fixed(status?.fps, 1)}</span> <small>frames/s</small></p>
    ${status?.recording ? html`<span class="pill recording" data-testid="recording"
      role="status">${`recording ${status.recording}`}</span>` : nothing}
    <span id="state" class="pill" data-testid="state" role="status" title=${state.why}>${state.text}</span>
    <a class="link" href="calibrate.html" data-testid="calibrate">Calibrate</a>`;
}
