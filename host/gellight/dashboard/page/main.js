// The live page: newest frame in, everything drawn, one credit back.

import { Banners } from "./banners.js";
import { Choices } from "./choices.js";
import { command, fetchFile } from "./command.js";
import { Connection } from "./connection.js";
import { element, render, write } from "./dom.js";
import { bundleText, contactFigures, contactRows, diagnostics, fixed, header, lamps } from "./figures.js";
import { History } from "./history.js";
import { Link } from "./link.js";
import { Marks } from "./marks.js";
import { Measure } from "./measure.js";
import { Decoder } from "./message.js";
import { Pictures } from "./pictures.js";
import { Planes } from "./planes.js";
import { PressPanel } from "./press.js";
import { Recent } from "./recent.js";
import { ScanPanel } from "./scan.js";
import { savePng } from "./saving.js";
import { judge } from "./state.js";
import { listenToKeys, offerFullScreen } from "./toolbar.js";

const FPS_WINDOW_MS = 2000;
const TICK_MS = 200;
const LOOK_MS = 3000; // how often other sensors are looked for
const LEVELS = ["320 × 240 mesh", "160 × 120 mesh", "2D relief"]; // how finely the surface is drawn
const RELIEF = LEVELS.length - 1;
const UNDECODED_MS = 1000; // a frame that cannot be shown is followed by the next one after this time

/** What the page knows, for scripts and tests. */
const stats = {
  state: "connecting", sequence: -1, drawn: 0, drawn_fps: 0, fps: null, age_ms: null, level: "", indentation_mm: null,
  area_mm2: null, centroid_mm: null, contacts: [], pose: null, section: null, error: null, kept: 0, surface: "waiting",
};
window.gellight = stats;

let surface = null; // drawn in 3D; its library is most of the page's bytes, so the first frame does not wait for it
let waiting = null; // the newest view not yet drawn
let shown = null; // the view on the screen
let status = null; // what the server said last
let sensors = []; // [name, address] of those that have a page on this computer
let paused = false;
let swallowed = 0; // credits to give back at the end of a pause
let asked = false; // the browser will call `turn`
let noSurface = ""; // why there is no 3D
let undecoded = ""; // why the newest frame cannot be shown
let drawnTimes = [];
let tickedAt = 0;

const planes = new Planes();
const decoder = new Decoder(() => planes.drawDifference());
const recent = new Recent();
const link = new Link();
const choices = new Choices();
const measure = new Measure(mark);
const press = new PressPanel();
const scan = new ScanPanel(press);
const marks = new Marks();
const pictures = new Pictures(measure, press, () => (measuring() ? measure : press));
const history = new History(element("history"), recent, revisit);
const connection = new Connection({
  open: () => { stats.connected = true; },
  lost: () => {
    stats.connected = false;
    swallowed = 0;
    link.reset();
    press.reset();
  },
  frame: receive,
  status: takeStatus,
});
const banners = new Banners(element("banners"), {
  retry: () => connection.retryNow(),
  resume: () => pause(false),
  diagnose: () => { element("diagnostics").open = true; },
  show: tick,
});

async function openSurface() {
  const { Surface } = await import("./surface.js");
  try {
    surface = new Surface(element("surface"), planes, again);
  } catch (error) {
    noSurface = `: ${error.message}`;
    console.info(`the surface is drawn in 2D: ${error.message}`);
    element("detail").disabled = true;
    stats.surface = "2D";
    return;
  }
  surface.canvas.addEventListener("pointermove", (event) => event.buttons || measure.pointAt(surface.placeAt(event)));
  surface.canvas.addEventListener("pointerleave", () => measure.pointAt(null));
  surface.update(shown);
  drawSurface();
  stats.surface = "3D";
}

// ---- frames ----

async function receive(buffer) {
  const view = await decoder.decode(buffer).catch((error) => {
    undecoded = `A frame cannot be shown: ${error.message}.`;
    setTimeout(giveCredit, UNDECODED_MS);
  });
  if (!view) return;
  undecoded = "";
  recent.add(view.header.time_s, buffer, view.header.contact.indentation_mm);
  if (waiting) giveCredit();
  waiting = view;
  again();
}

/** Let the browser call `turn`: only where something is to be drawn, for every call has it compose the whole page. */
function again() {
  if (!asked) requestAnimationFrame(turn);
  asked = true;
}

function giveCredit() {
  if (paused) swallowed++;
  else connection.grant(1);
}

function turn() {
  asked = false;
  if (waiting && !paused) {
    const view = waiting;
    waiting = null;
    draw(view);
    if (performance.now() - tickedAt > TICK_MS) tick(); // together with the pictures, so that the page is composed once
    giveCredit();
  } else if (shown) drawSurface();
}

function draw(view) {
  const { sequence, contact, contacts, pose } = view.header;
  if (!shown) openSurface();
  shown = view;
  contacts.sort((one, other) => one.number - other.number);
  pictures.learn(view.header);
  planes.draw(view);
  surface?.update(view);
  measure.show(view);
  marks.follow(pose);
  drawSurface();
  overlay();
  if (sequence !== stats.sequence) drawnTimes.push(performance.now());
  Object.assign(stats, contact, { sequence, contacts, pose, drawn: stats.drawn + 1 });
}

/** How finely the surface is drawn, of `LEVELS`. */
function level() {
  const detail = element("detail").value;
  if (!surface) return RELIEF;
  return Number(detail === "auto" ? surface.software : detail);
}

function drawSurface() {
  const chosen = (id) => Number(element(id).value);
  const exaggeration = chosen("exaggeration");
  const flat = level() === RELIEF;
  planes.relief.canvas.hidden = !flat;
  if (surface) surface.canvas.hidden = flat;
  if (flat) planes.drawRelief(exaggeration);
  else surface.draw(level(), exaggeration, chosen("surface-colour"), measure.places);
  stats.level = LEVELS[level()];
}

/** Draw what lies over the pictures and the surface, after it has changed. */
function mark() {
  if (!shown) return;
  overlay();
  again();
}

function overlay() {
  marks.draw(shown.header, measure);
  stats.section = measure.section;
}

// ---- what the server says, and how old all that is ----

function takeStatus(said) {
  status = said;
  link.note(performance.now() / 1000, said.now_s);
  stats.fps = said.fps ?? null;
  stats.error = said.error ?? null;
  element("track").setAttribute("aria-pressed", Boolean(said.tracking));
  press.show(said.stage);
  scan.show(said);
}

function tick() {
  const now = performance.now();
  tickedAt = now;
  history.draw();
  drawnTimes = drawnTimes.filter((time) => now - time < FPS_WINDOW_MS);
  stats.drawn_fps = drawnTimes.length / (FPS_WINDOW_MS / 1000);
  stats.kept = recent.count;
  const behindS = link.behindS(now / 1000);
  const kept = `${recent.count} frames, ${(recent.bytes / 1e6).toFixed(0)} MB`;
  render(diagnostics(status, { drawnFps: stats.drawn_fps, behindMs: behindS * 1000, kept }), element("drawer"));
  write("level", level() === RELIEF ? `${LEVELS[RELIEF]}${noSurface}` : `${LEVELS[level()]}, grid 5 mm`);
  showFrame(shown?.header ?? { contact: {}, contacts: [] });
  showState(now / 1000, behindS);
}

function showFrame(said) {
  render(contactFigures(said), element("figures"));
  render(contactRows(said.contacts), element("contacts"));
  render(lamps(said.light), element("ring"));
  write("pose", said.pose?.text ?? "");
  if (!said.truth) return;
  const { indentation_mm: indentation, depth_error_mm: error } = said.truth;
  write("truth-error", `indentation ${fixed(indentation, 3)} mm · error ${fixed(error * 1000, 1)} µm`);
}

function showState(nowS, behindS) {
  const ageS = shown && !paused ? link.ageS(nowS, shown.header.time_s) : null;
  stats.age_ms = ageS === null ? stats.age_ms : ageS * 1000;
  const state = judge({ connected: stats.connected, paused, status, ageS, behindS });
  stats.state = state.name;
  document.body.dataset.state = state.name;
  render(header(status, state, sensors), element("header"));
  press.forbid(state.noPress);
  banners.show(state, status, undecoded);
}

async function lookForSensors() {
  const answer = await fetch("sensors").catch(() => null);
  sensors = Object.entries(answer?.ok ? await answer.json() : {});
  setTimeout(lookForSensors, LOOK_MS);
}

// ---- pause, and earlier frames ----

function pause(wanted) {
  paused = wanted;
  element("pause").setAttribute("aria-pressed", paused);
  element("pause").textContent = paused ? "Resume" : "Pause";
  for (const id of ["save-npz", "save-ply"]) element(id).disabled = paused; // they are of the newest frame
  history.cursorS = paused && shown ? shown.header.time_s : null;
  if (paused) return;
  again();
  if (swallowed) connection.grant(swallowed);
  swallowed = 0;
}

async function revisit(frame) {
  if (!paused || !frame) return;
  const view = await decoder.decode(frame.buffer);
  if (!paused) return;
  draw(view);
  history.cursorS = frame.timeS;
  history.draw();
}

// ---- what the visitor chooses ----

function measuring() {
  return element("measure").getAttribute("aria-pressed") === "true";
}

function chooseMeasure(wanted) {
  element("measure").setAttribute("aria-pressed", wanted);
}

function savePictures() {
  drawSurface();
  const solid = level() === RELIEF ? planes.relief : surface;
  const { depth, truth, image, difference, normal } = planes;
  const known = shown.truth ? { "True depth": truth } : {};
  const named = { Surface: solid, Depth: depth, ...known, Camera: image, Difference: difference, Normals: normal };
  savePng(shown, named, `${status?.sensor} · ${bundleText(status?.calibration)}`);
}

const CHOICES = {
  scale: (um) => planes.setScale(Number(um)),
  map: (name) => planes.setMap(name),
  gain: (gain) => planes.setGain(Number(gain)),
  span: (seconds) => { history.spanS = Number(seconds); },
};
for (const id of ["exaggeration", "surface-colour", "detail", ...Object.keys(CHOICES)]) {
  choices.keep(element(id), (value) => {
    CHOICES[id]?.(value);
    again();
  });
}
choices.keep(element("diagnostics"));
element("diagnostics").addEventListener("toggle", ({ target }) => {
  if (target.open) target.scrollIntoView({ block: "nearest" });
});

const CLICKS = {
  pause: () => pause(!paused),
  measure: () => chooseMeasure(!measuring()),
  track: () => command({ type: "track", on: !status?.tracking, hand: true }), // what is simulated moves by itself then
  "save-png": () => shown && savePictures(),
  "save-npz": async () => write("readout", await fetchFile("frame/npz")),
  "save-ply": async () => write("readout", await fetchFile("frame/ply")),
  "reset-view": () => {
    choices.reset();
    surface?.orbit.reset();
  },
};
for (const [id, act] of Object.entries(CLICKS)) element(id).addEventListener("click", act);
offerFullScreen(element("full-screen"));
listenToKeys(() => {
  if (measure.line) measure.clear();
  else chooseMeasure(false);
});

lookForSensors();
tick();
setInterval(() => performance.now() - tickedAt > TICK_MS && tick(), TICK_MS / 2);
