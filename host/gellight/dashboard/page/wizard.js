// The calibration wizard: shows the state of the routine, and sends it what the visitor chose.

import { drawCurve, drawPlaces, drawSlopes } from "./charts.js";
import { CirclePicture } from "./circle.js";
import { command as ask } from "./command.js";
import { button, element, node, row } from "./dom.js";
import { figureRows } from "./wizard_figures.js";
import { ACTION_NAMES, PICTURE_NAMES, STEP_NAMES, advice, instruction, pictureNote, presetNote } from "./wizard_texts.js";

const POLL_MS = 300;
const MOST_VIEW_BYTES = 10000; // as the server takes
const ENDS = ["finished", "aborted", "failed"];

/** What the page knows, for scripts and tests. */
const stats = { state: null, picture: null, shown: 0, losses: [] };
window.wizard = stats;

const picture = new CirclePicture(element("picture"), (circle) => command({ type: "act", action: "correct", ...circle }));
let filled = false; // whether the form holds the defaults
let chosen = "auto"; // which picture the visitor wants

async function poll() {
  if (!document.hidden) {
    try {
      const answer = await fetch("calibration");
      const state = await answer.json();
      if (!answer.ok) throw new Error(state.message);
      takeIn(state);
      showError("");
    } catch (error) {
      showError(error instanceof TypeError ? "the sensor's program does not answer; it is asked again" : error.message);
    }
    await showPicture();
  }
  setTimeout(poll, POLL_MS);
}

async function command(call) {
  showRefusal(await ask(call));
}

function showError(text) {
  element("error").textContent = text;
}

let refusal = "";

function showRefusal(text) {
  refusal = text;
  element("problem").textContent = text;
}

function takeIn(state) {
  stats.state = state;
  element("sensor").textContent = state.sensor;
  const routine = state.routine;
  const running = Boolean(routine) && !ENDS.includes(routine.step);
  document.body.dataset.step = routine?.step ?? "";
  showSteps(routine);
  showGuide(state, routine, running);
  showNeeds(running || routine?.step === "finished" ? [] : state.needs);
  showRequest(state, running);
  showActions(routine, running, state);
  showCoverage(routine?.figures?.presses);
  showLoss(routine);
  showVerdict(routine);
  showFigures(routine?.figures);
  showBundles(state, running);
  offerPictures(routine);
}

function showSteps(routine) {
  const steps = routine?.steps ?? Object.keys(STEP_NAMES).map((name) => ({ name, state: "to do" }));
  element("steps").replaceChildren(...steps.map(({ name, state }) => {
    const item = node("li", "", state.replace(" ", "-"));
    item.append(node("span", STEP_NAMES[name] ?? name));
    item.title = `${STEP_NAMES[name] ?? name}: ${state}`;
    if (state === "now") item.setAttribute("aria-current", "step");
    return item;
  }));
}

function showGuide(state, routine, running) {
  element("instruction").textContent = instruction(state, routine, running);
  element("advice").textContent = advice(state, routine, running);
  element("problem").textContent = routine?.problem || refusal;
  const { done, wanted, unit } = routine?.progress ?? {};
  element("progress").hidden = !running || done === undefined;
  if (done !== undefined) {
    Object.assign(element("progress-bar"), { max: wanted, value: done });
    element("done").textContent = `${done} of ${wanted} ${unit}`;
  }
}

/** The check list before the start: what is ready, what is missing, what only the visitor can see to. */
function showNeeds(needs) {
  element("needs").hidden = needs.length === 0;
  const marks = { ready: "✓", missing: "✗", yours: "○" };
  const words = { ready: "ready", missing: "missing", yours: "for you to see to" };
  element("needs").replaceChildren(...needs.map(({ name, state, text }) => {
    const mark = node("span", marks[state], "mark");
    mark.setAttribute("role", "img");
    mark.setAttribute("aria-label", words[state]);
    const item = node("li", "", state);
    item.append(mark, node("strong", name), node("span", text));
    return item;
  }));
}

function showRequest(state, running) {
  element("request").hidden = running;
  element("hand-row").hidden = !state.simulated;
  element("anew-row").hidden = !state.interrupted;
  element("kind-row").hidden = state.simulated || state.interrupted;
  element("kind-note").hidden = running || !element("kind").value;
  const goesOn = state.interrupted && !element("anew").checked;
  const prepared = goesOn ? state.interrupted_picture : state.picture;
  for (const id of ["view-row", "dots-row"]) element(id).hidden = state.simulated || goesOn || Boolean(prepared);
  element("picture-note").hidden = running || !prepared;
  element("picture-note").textContent = pictureNote(prepared);
  offerUnits(state);
  if (filled) return;
  filled = true;
  const { defaults, presets } = state;
  element("kind").append(...presets.map(({ name, title }) => new Option(title, name)));
  element("ball").value = defaults.ball_radius_mm;
  element("cylinder").value = defaults.cylinder_diameter_mm;
  element("pixel").value = defaults.pixel_size_mm ?? "";
  element("presses").value = defaults.presses;
  element("hand").checked = defaults.hand;
}

let offeredUnits = "";

/** The units whose presses a calibration can begin with. */
function offerUnits({ units, interrupted }) {
  const key = JSON.stringify([units, interrupted]);
  if (key === offeredUnits) return;
  offeredUnits = key;
  const { value } = element("like");
  const option = (text, identity) => new Option(text, identity, false, identity === value);
  const known = units.map(({ name, sensor, created, identity }) => option(`${name || sensor}, ${new Date(created).toLocaleDateString()}`, identity));
  element("like").replaceChildren(option(interrupted ? "as it was begun" : "none", ""), ...known);
  element("like-row").hidden = !known.length;
}

/** The view file that was chosen, as the server reads it; throws, in words, for one that cannot be a view. */
async function chosenView() {
  const [file] = element("view-row").hidden ? [] : element("view").files;
  if (!file) return null;
  if (file.size > MOST_VIEW_BYTES) throw new Error(`${file.name} is no view (${file.size} bytes, a view has at most ${MOST_VIEW_BYTES}): make it with \`gellight calibrate view\``);
  return { name: file.name, content: await file.text() };
}

/** Another file was chosen, or none: what was said of the last one no longer holds. */
function noteView() {
  element("no-view").hidden = element("view").files.length === 0;
  showRefusal("");
}

async function request() {
  return {
    view: await chosenView(),
    dots: element("dots").checked && !element("dots-row").hidden,
    ball_radius_mm: element("ball").valueAsNumber,
    cylinder_diameter_mm: element("cylinder").valueAsNumber,
    pixel_size_mm: element("pixel").value ? element("pixel").valueAsNumber : null,
    presses: element("presses").valueAsNumber,
    like: element("like").value,
    hand: element("hand").checked,
    anew: element("anew").checked,
  };
}

/** Take the ball of the kind of sensor that was chosen, and say what is known of it. */
function choosePreset() {
  const preset = stats.state.presets.find(({ name }) => name === element("kind").value);
  element("kind-note").hidden = !preset;
  element("ball").value = preset?.ball_radius_mm ?? stats.state.defaults.ball_radius_mm;
  element("kind-note").textContent = preset ? presetNote(preset) : "";
}

async function begin() {
  if (!element("request").reportValidity()) return;
  stats.losses = [];
  try {
    await command({ type: "calibrate", request: await request() });
  } catch (error) {
    showRefusal(error.message);
  }
}

/** After a calibration the live view is what everybody wants to see. */
function liveLink() {
  return node("a", "Live view", "button first", { href: "./", testid: "action-live" });
}

let offered = "";

function showActions(routine, running, state) {
  const done = routine?.step === "finished" && routine.verdict?.passed !== false;
  const actions = running ? routine.actions.filter((name) => name !== "correct") : done ? ["live", "begin"] : ["begin"];
  const key = [...actions, state.interrupted, Boolean(routine)].join();
  if (key === offered) return; // a button that is being pressed stays where it is
  offered = key;
  const label = { ...ACTION_NAMES, begin: state.interrupted ? "Go on" : routine ? "Calibrate again" : "Start the calibration" };
  element("actions").replaceChildren(...actions.map((name, place) => {
    if (name === "live") return liveLink();
    const act = () => (name === "begin" ? begin() : command({ type: "act", action: name }));
    return button(label[name] ?? name, act, `${name} ${place === 0 && name !== "abort" ? "first" : ""}`, { testid: `action-${name}` });
  }));
}

function showCoverage(presses) {
  element("coverage-panel").hidden = !presses;
  const points = presses?.held_out ?? [];
  element("held-out-panel").hidden = points.length < 2;
  if (!presses) return;
  const { coverage } = presses;
  drawPlaces(element("places"), coverage.places);
  element("places-note").textContent = placesNote(coverage.places.flat());
  if (coverage.slopes) drawSlopes(element("slopes"), coverage.slopes, coverage.steepness_deg);
  element("steepest").textContent = coverage.steepest_deg ? `up to ${coverage.steepest_deg}°` : "";
  if (points.length < 2) return;
  drawCurve(element("held-out"), points, "presses");
  const shape = presses.held_out_um == null ? "" : `, ${presses.held_out_um.toFixed(0)} µm`;
  element("held-out-now").textContent = `${points.at(-1)[1].toFixed(2)}°${shape}`;
}

/** What the map says in words: the same places that the advice counts. */
function placesNote(counts) {
  const empty = counts.filter((count) => count === 0).length;
  return `presses that reached each place; ${empty === 0 ? "none is empty" : `${empty} of ${counts.length} are empty`}`;
}

function showLoss(routine) {
  const progress = routine?.progress ?? {};
  if (progress.loss !== undefined) stats.losses[progress.done] = progress.loss;
  const known = routine?.figures?.fit?.losses;
  const points = known ? known.map((loss, epoch) => [epoch + 1, loss]) : Object.entries(stats.losses).map(([epoch, loss]) => [Number(epoch), loss]);
  element("loss-panel").hidden = points.length < 2;
  if (points.length < 2) return;
  drawCurve(element("loss"), points, "epoch");
  element("loss-now").textContent = points.at(-1)[1].toPrecision(3);
}

function showVerdict(routine) {
  const verdict = routine?.verdict;
  element("verdict-panel").hidden = !verdict;
  if (!verdict) return;
  element("verdict").textContent = verdict.text;
  element("verdict").className = `verdict-text ${verdict.passed ? "passed" : "failed"}`;
  element("bundle").textContent = verdict.passed && routine.step === "finished" ? `in service: ${stats.state.in_service}` : "";
}

function showFigures(figures) {
  const rows = figureRows(figures ?? {});
  element("figures-panel").hidden = rows.length === 0;
  element("figures").replaceChildren(...rows.map(([name, value]) => row(node("td", name, "dim"), node("td", value))));
}

let listed = "";

function showBundles(state, running) {
  const key = JSON.stringify([state.bundles, running, state.in_service]);
  if (key === listed) return;
  listed = key;
  const known = state.bundles.map((bundle) => bundleRow(bundle, running));
  const nothing = row(node("td", "none yet; the sensor runs with the bundle it was started with", "dim"));
  element("bundles").replaceChildren(...(known.length ? known.reverse() : [nothing]));
}

function bundleRow(bundle, running) {
  const made = bundle.created ? new Date(bundle.created).toLocaleString() : bundle.problem;
  const last = node("td", "");
  const { identity } = bundle;
  if (bundle.report && !bundle.problem) last.append(node("a", "Report", "report", { href: `calibration/report/${identity}`, target: "_blank", testid: `report-${identity}` }));
  if (bundle.in_service) last.append(node("span", "in service", "passed"));
  else if (!bundle.problem) last.append(button("Restore", () => command({ type: "restore", identity }), "", { disabled: running, testid: `restore-${identity}` }));
  return row(node("td", bundle.identity, "mono"), node("td", made, bundle.problem ? "problem" : "dim"), last);
}

function offerPictures(routine) {
  const names = ["live", ...(routine?.pictures ?? []).filter((name) => name !== "live")];
  const choice = element("which");
  if (choice.childElementCount === names.length + 1) return;
  const option = (name, text) => new Option(text, name, false, name === chosen);
  choice.replaceChildren(option("auto", "what matters"), ...names.map((name) => option(name, PICTURE_NAMES[name] ?? name)));
}

/** The picture that helps most now: the press that can still be corrected, else what is seen. */
function wanted() {
  if (chosen !== "auto") return chosen;
  const routine = stats.state?.routine;
  if (routine?.press && ["presses", "verify"].includes(routine.step)) {
    const shown = ["difference", "press"].find((name) => routine.pictures.includes(name));
    if (shown) return shown;
  }
  if (routine?.step === "finished" && routine.pictures.includes("verify")) return "verify";
  return "live";
}

async function showPicture() {
  const name = wanted();
  const routine = stats.state?.routine;
  const ofPress = ["press", "difference"].includes(name);
  const editable = ofPress && Boolean(routine?.actions.includes("correct"));
  element("circle-hint").hidden = !editable;
  if (picture.dragging) return;
  const answer = await fetch(`calibration/picture/${name}`).catch(() => null);
  if (!answer?.ok) return;
  const image = await createImageBitmap(await answer.blob());
  if (picture.dragging) return;
  picture.show(image);
  picture.lay(ofPress ? routine?.press : null, editable);
  element("picture-title").textContent = PICTURE_NAMES[name] ?? name;
  Object.assign(stats, { picture: name, shown: stats.shown + 1 });
}

element("which").addEventListener("change", (event) => { chosen = event.target.value; });
element("kind").addEventListener("change", choosePreset);
element("view").addEventListener("change", noteView);
element("no-view").addEventListener("click", () => { element("view").value = ""; noteView(); });
element("request").addEventListener("submit", (event) => { event.preventDefault(); begin(); });

poll();
