// The live page: newest frame in, everything drawn, one credit back.

import { Banners } from "./banners.js";
import { Choices } from "./choices.js";
import { offerSensors } from "./chooser.js";
import { Connection } from "./connection.js";
import { element, write } from "./dom.js";
import { showContact, showContacts, showForce, showStatus } from "./figures.js";
import { History } from "./history.js";
import { Link } from "./link.js";
import { Measure } from "./measure.js";
import { Decoder } from "./message.js";
import { Pictures } from "./pictures.js";
import { Planes, fillMaps, fillScales } from "./planes.js";
import { PressPanel } from "./press.js";
import { Recent } from "./recent.js";
import { Relief } from "./relief.js";
import { Ring } from "./ring.js";
import { ScanPanel } from "./scan.js";
import { fetchFile, savePng } from "./saving.js";
import { arrowsOf, showShear } from "./shear.js";
import { judge, tellBanners } from "./state.js";
import { listenToKeys, offerFullScreen } from "./toolbar.js";
import { Tracking } from "./tracking.js";
import { Truth } from "./truth.js";
import { WatchNotice } from "./watch.js";

const FPS_WINDOW_MS = 2000;
const TICK_MS = 200;
const LEVELS = ["320 × 240 mesh", "160 × 120 mesh", "2D relief"]; // how finely the surface is drawn
const RELIEF = LEVELS.length - 1;
const UNDECODED_MS = 1000; // a frame that cannot be shown is followed by the next one after this time

/** What the page knows, for scripts and tests. */
const stats = {
  state: "connecting", sequence: -1, drawn: 0, drawn_fps: 0, fps: null, age_ms: null, level: "",
  indentation_mm: null, area_mm2: null, centroid_mm: null, contacts: [], pose: null, section: null, error: null, kept: 0, surface: "waiting",
};
window.gellight = stats;

const planes = new Planes();
const decoder = new Decoder((view) => planes.complete(view));
const truth = new Truth();
const ring = new Ring(element("ring"));
const recent = new Recent();
const link = new Link();
const banners = new Banners(element("banners"));
const watch = new WatchNotice();
const choices = new Choices();
const measure = new Measure(mark);
const relief = new Relief(element("surface"));
let surface = null; // drawn in 3D; its library is most of the page's bytes, so the first frame does not wait for it
let level = RELIEF; // of `LEVELS`
const history = new History(element("history"), { choose: (timeS) => revisit(recent.nearest(timeS)), step: (count) => revisit(recent.step(shown?.header.time_s, count)) });

let moving = null; // the axes of the tracked object and its way
let waiting = null; // the newest view not yet drawn
let shown = null; // the view on the screen
let status = null; // what the server said last
let paused = false;
let swallowed = 0; // credits to give back at the end of a pause
let turned = false; // the surface has to be drawn again without a new frame
let asked = false; // the browser will call `turn`
let noSurface = ""; // why there is no 3D
let drawnTimes = [];
let tickedAt = 0;

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
const press = new PressPanel();
const tracking = new Tracking(element("track"));
const scan = new ScanPanel(press);
const tool = () => (measuring() ? measure : press);
const pictures = new Pictures([...planes.canvases, element("truth")], {
  point: (place) => measure.pointAt(place),
  down: (place) => tool().down(place),
  move: (place) => tool().move(place),
  up: () => tool().up(),
  enter: (place) => tool().enter(place),
  wheel: (event) => press.wheel(event),
});

async function openSurface() {
  const { Surface } = await import("./surface.js");
  try {
    surface = new Surface(element("surface"), planes.imageCanvas, again);
  } catch (error) {
    noSurface = `: ${error.message}`;
    console.info(`the surface is drawn in 2D: ${error.message}`);
    element("detail").disabled = true;
    stats.surface = "2D";
    return;
  }
  surface.canvas.addEventListener("pointermove", (event) => event.buttons || measure.pointAt(surface.placeAt(event)));
  surface.canvas.addEventListener("pointerleave", () => measure.pointAt(null));
  choices.apply();
  surface.update(shown, planes.normalPixels);
  drawSurface();
  stats.surface = "3D";
}

// ---- frames ----

async function receive(buffer) {
  const view = await decoder.decode(buffer).catch((error) => tellUndecoded(error));
  if (!view) return;
  banners.hide("undecoded");
  recent.add(view.header.time_s, buffer);
  history.add(view.header.time_s, view.header.contact.indentation_mm);
  if (waiting) {
    waiting.bitmap.close();
    giveCredit();
  }
  waiting = view;
  ask();
}

/** Say why a frame cannot be shown, and wait for the next one. */
function tellUndecoded(error) {
  banners.show("undecoded", "fault", `A frame cannot be shown: ${error.message}.`, [["Reload", () => location.reload()]]);
  setTimeout(giveCredit, UNDECODED_MS);
}

/** Let the browser call `turn`: only where something is to be drawn, for every call has it compose the whole page. */
function ask() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(turn);
}

/** Have the surface drawn again. */
function again() {
  turned = true;
  ask();
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
  } else if (turned && shown) {
    drawSurface();
  }
  turned = false;
}

function draw(view) {
  if (!shown) openSurface();
  shown = view;
  pictures.learn(view.header);
  planes.draw(view);
  view.bitmap.close();
  truth.draw(view, planes.colours);
  surface?.update(view, planes.normalPixels);
  measure.show(view);
  moving = tracking.follow(view.header.pose);
  stats.pose = view.header.pose;
  stats.contacts = view.header.contacts.toSorted((one, other) => one.number - other.number);
  drawSurface();
  overlay();
  ring.show(view.header.light);
  count(view.header);
}

function drawSurface() {
  const flat = level === RELIEF;
  relief.canvas.hidden = !flat;
  if (surface) surface.canvas.hidden = flat;
  if (flat) relief.draw(shown, planes.depthPixels, Number(element("exaggeration").value));
  else {
    surface.drawLine(measure.places);
    surface.draw(level);
  }
  stats.level = LEVELS[level];
}

/** Draw what lies over the pictures and the surface, after it has changed. */
function mark() {
  if (!shown) return;
  overlay();
  again();
}

/** Draw what lies over the pictures: the line, the place pointed at, the numbers of the contacts. */
function overlay() {
  const several = stats.contacts.length > 1 ? stats.contacts : [];
  const labels = several.map(({ number, centroid_mm: place }) => [String(number), place]);
  pictures.mark({ line: measure.line, point: measure.point, moving, labels, ...arrowsOf(shown.header.shear) });
  stats.section = measure.section;
}

function count({ sequence, contact }) {
  if (sequence !== stats.sequence) drawnTimes.push(performance.now());
  Object.assign(stats, contact, { sequence, drawn: stats.drawn + 1 });
}

// ---- what the server says, and how old all that is ----

function takeStatus(said) {
  status = said;
  link.note(performance.now() / 1000, said.now_s);
  stats.fps = said.fps ?? null;
  stats.error = said.error ?? null;
  showStatus(said);
  press.show(said.stage);
  tracking.show(said);
  scan.show(said);
  watch.show(said.watch);
}

function tick() {
  const now = performance.now();
  tickedAt = now;
  if (!paused) history.draw();
  drawnTimes = drawnTimes.filter((time) => now - time < FPS_WINDOW_MS);
  stats.drawn_fps = drawnTimes.length / (FPS_WINDOW_MS / 1000);
  write("drawn-fps", stats.drawn_fps.toFixed(1));
  write("level", level === RELIEF ? `${LEVELS[RELIEF]}${noSurface}` : `${LEVELS[level]}, grid 5 mm`);
  write("link-behind", (link.behindS(now / 1000) * 1000).toFixed(0));
  stats.kept = recent.count;
  write("kept", `${recent.count} frames, ${(recent.bytes / 1e6).toFixed(0)} MB`);
  if (shown) {
    showContact(shown.header.contact);
    showForce(shown.header.force);
    showShear(shown.header.shear, shown.header.force);
    truth.write(shown.header.truth);
    showContacts(stats.contacts);
  }
  judgeState(now / 1000);
}

function judgeState(nowS) {
  const ageS = shown && !paused ? link.ageS(nowS, shown.header.time_s) : null;
  stats.age_ms = ageS === null ? stats.age_ms : ageS * 1000;
  const state = judge({ connected: stats.connected, paused, status, ageS, behindS: link.behindS(nowS) });
  stats.state = state.name;
  document.body.dataset.state = state.name;
  write("state", state.text);
  element("state").title = state.why;
  press.forbid(state.noPress);
  tellBanners(banners, state, status, { retry: () => connection.retryNow(), resume: () => pause(false), diagnose });
}

function diagnose() {
  element("diagnostics").open = true;
}

element("diagnostics").addEventListener("toggle", ({ target }) => target.open && target.scrollIntoView({ block: "nearest" }));

// ---- pause, and earlier frames ----

function pause(wanted) {
  paused = wanted;
  element("pause").setAttribute("aria-pressed", paused);
  element("pause").textContent = paused ? "Resume" : "Pause";
  document.body.classList.toggle("paused", paused);
  for (const id of ["save-npz", "save-ply"]) element(id).disabled = paused; // they are of the newest frame
  if (paused) return;
  ask();
  history.cursorS = null;
  if (swallowed) connection.grant(swallowed);
  swallowed = 0;
}

async function revisit(frame) {
  if (!paused || !frame) return;
  const view = await decoder.decode(frame.buffer);
  if (!paused) return;
  draw(view);
  history.cursorS = frame.timeS;
}

// ---- what the visitor chooses ----

const measuring = () => element("measure").getAttribute("aria-pressed") === "true";

function chooseMeasure(wanted) {
  element("measure").setAttribute("aria-pressed", wanted);
  document.body.classList.toggle("measuring", wanted);
}

function savePictures() {
  drawSurface();
  const solid = level === RELIEF ? relief.canvas : surface.canvas;
  const named = [["Surface", solid], ["Depth", element("depth")], ["True depth", element("truth")], ["Camera", element("image")], ["Difference", element("difference")], ["Normals", element("normal")]];
  savePng(shown, named.filter(([title]) => title !== "True depth" || shown.truth), { sensor: element("sensor").textContent, bundle: element("bundle").textContent });
}

function onClick(id, act) {
  element(id).addEventListener("click", act);
}

fillMaps(element("map"));
fillScales(element("scale"), planes.scaleUm);
const redraw = (act) => (value) => {
  act(value);
  again();
};
choices.select(element("scale"), redraw((um) => {
  planes.setScale(Number(um));
  if (shown) truth.draw(shown, planes.colours);
  if (surface) surface.scaleUm = Number(um);
}));
choices.select(element("map"), redraw((name) => {
  planes.setMap(name);
  if (shown) truth.draw(shown, planes.colours);
  surface?.recolour();
}));
choices.select(element("gain"), redraw((gain) => planes.setGain(Number(gain))));
choices.select(element("exaggeration"), redraw((times) => { if (surface) surface.exaggeration = Number(times); }));
choices.select(element("surface-colour"), redraw((mode) => { if (surface) surface.colouring = Number(mode); }));
choices.select(element("detail"), redraw((chosen) => { if (surface) level = chosen === "auto" ? Number(surface.software) : Number(chosen); }));
choices.select(element("span"), (seconds) => { history.spanS = Number(seconds); });
choices.details(element("diagnostics"));

onClick("pause", () => pause(!paused));
onClick("measure", () => chooseMeasure(!measuring()));
onClick("save-png", () => shown && savePictures());
for (const kind of ["npz", "ply"]) onClick(`save-${kind}`, async () => write("readout", await fetchFile(`frame/${kind}`)));
onClick("reset-view", () => {
  choices.reset();
  surface?.orbit.reset();
});
offerFullScreen(element("full-screen"));
offerSensors(element("sensors"));
listenToKeys(() => {
  if (measure.line) measure.clear();
  else chooseMeasure(false);
});

setInterval(() => performance.now() - tickedAt > TICK_MS && tick(), TICK_MS / 2);
