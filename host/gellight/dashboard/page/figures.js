// The numbers of the page.

import { element, node, row, write } from "./dom.js";

/** `value` with `digits` digits, without a minus before zero; a dash where it is not known. */
export function fixed(value, digits) {
  if (typeof value !== "number") return "–";
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

/** Show what one frame says of the contact. */
export function showContact({ indentation_mm: indentation, area_mm2: area, centroid_mm: centroid }) {
  write("indentation", fixed(indentation, 3));
  write("area", fixed(area, 1));
  write("centroid", centroid ? centroid.map((mm) => fixed(mm, 2)).join(", ") : "–");
}

/** Show the contacts of a frame; the sensor numbers them, and each keeps its number while it lasts. */
export function showContacts(contacts) {
  const cells = ({ number, depth_mm: depth, area_mm2: area, volume_mm3: volume, slope_rad: slope }) => [
    String(number), fixed(depth, 3), fixed(area, 2), fixed(volume, 2), fixed(slope === null ? null : (slope * 180) / Math.PI, 1),
  ];
  fill("contacts", contacts, () => contacts.map((contact) => row(...cells(contact).map((text) => node("td", text)))));
}

const FORCE_FLAGS = { beyond_view: "and more beyond the view", heavier: "heavier than calibrated" };

/** Show the normal force of one frame; nothing where the bundle has no constant for it. */
export function showForce(force) {
  element("force-row").hidden = !force;
  if (!force) return;
  write("force", fixed(force.normal_n, 2));
  write("force-error", `±${fixed(force.error_n, 2)}`);
  element("force-row").title = force.flags.map((flag) => FORCE_FLAGS[flag] ?? flag).join(", ");
  element("force-row").classList.toggle("notice", force.flags.length > 0);
}

/** Show what the daemon says of itself. */
export function showStatus(status) {
  write("sensor", status.sensor ?? "");
  element("sensor").title = status.sensor ?? "";
  write("bundle", bundleText(status.calibration));
  element("bundle").title = element("bundle").textContent;
  element("recording").hidden = !status.recording;
  write("recording", status.recording ? `recording ${status.recording}` : "");
  write("fps", fixed(status.fps, 1));
  write("age-median", fixed(status.frame_age_ms?.median, 1));
  write("age-p95", fixed(status.frame_age_ms?.p95, 1));
  write("dropped", String(status.dropped ?? "–"));
  write("mode", modeOf(status));
  showHeat(status.ring);
  showStages(status.stage_ms ?? {});
}

/** How warm the light ring is; nothing where its board does not know. */
function showHeat(ring) {
  const known = [["ring_c", ""], ["chip_c", "chip "]].filter(([key]) => typeof ring?.[key] === "number");
  element("heat-row").hidden = !known.length;
  const dimmed = ring?.dimmed ? `, dimmed to 1/${2 ** ring.dimmed}` : "";
  write("heat", known.map(([key, name]) => `${name}${fixed(ring[key], 0)} °C`).join(", ") + dimmed);
  element("heat-row").classList.toggle("notice", Boolean(dimmed));
}

/** Which bundle is in service, and the error that fresh presses have shown. */
function bundleText(calibration) {
  if (!calibration) return "–";
  const name = `${calibration.sensor} ${calibration.identity.slice(0, 6)}`;
  const { verified } = calibration;
  if (!verified) return `${name}, not verified`;
  // Without a truth the contact circle does not say how deep its rim lies, so only the shape of the dent is verified.
  const depth = typeof verified.true_depth_mm === "number" ? ["depth", verified.true_depth_mm] : ["shape", verified.depth_mm];
  return `${name}, ${depth[0]} ±${fixed(depth[1] * 1000, 0)} µm, normals ±${fixed(verified.normal_deg, 1)}°`;
}

/** How slopes are found, and what the last series of exposures said. */
function modeOf({ mode, exposures }) {
  if (mode === "photometric") {
    if (!exposures) return mode;
    return `${mode}, ${exposures.exposures} exposures${exposures.moved ? ", scene moved" : ""}`;
  }
  return "";
}

const written = new Map(); // id: what its children were made of

/** Put `children()` into an element, if `said` is not what they were made of last. */
function fill(id, said, children) {
  const key = JSON.stringify(said);
  if (written.get(id) === key) return;
  written.set(id, key);
  element(id).replaceChildren(...children());
}

function showStages(stages) {
  const longest = Math.max(1, ...Object.values(stages));
  fill("stages", stages, () => Object.entries(stages).map(([name, ms]) => {
    const line = node("div", "");
    line.append(node("dt", name), node("meter", "", "", { min: 0, max: longest, value: ms }), node("dd", fixed(ms, 1)));
    return line;
  }));
}
