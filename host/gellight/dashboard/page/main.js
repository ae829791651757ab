// The page: newest frame in, everything drawn, one credit back.

import { Connection } from "./connection.js";
import { Detail, LEVELS, RELIEF } from "./detail.js";
import { showContact, showStatus } from "./figures.js";
import { History } from "./history.js";
import { Decoder } from "./message.js";
import { Planes, fillScales } from "./planes.js";
import { PressPanel } from "./press.js";
import { Relief } from "./relief.js";
import { Ring } from "./ring.js";
import { Surface } from "./surface.js";
import { WatchNotice } from "./watch.js";

const STALE_S = 1; // without a new frame for so long the sensor is not live
const FPS_WINDOW_MS = 2000;

const element = (id) => document.getElementById(id);

/** What the page knows, for scripts and tests. */
const stats = {
  state: "connecting", sequence: -1, drawn: 0, drawn_fps: 0, fps: null, age_ms: null, level: "",
  indentation_mm: null, area_mm2: null, centroid_mm: null, error: null,
};
window.gellight = stats;

const planes = new Planes();
const ring = new Ring(element("ring"));
const history = new History(element("history"));
const relief = new Relief(element("surface"));
const surface = openSurface();
const detail = new Detail(firstLevel());

const decoder = new Decoder((view) => planes.complete(view));
let waiting = null; // the newest frame not yet drawn
let shown = null; // the view on the screen
let turned = false; // the surface has to be drawn again without a new frame
let drewAt = null; // when the last picture was begun, for the level of detail
let clockOffsetS = Infinity; // page clock minus the sensor's clock
let drawnTimes = [];

const connection = new Connection({
  open: () => setState("connected"),
  lost: () => {
    clockOffsetS = Infinity;
    press.reset();
    setState("lost");
  },
  frame: receive,
  status: takeStatus,
  answer: (answer) => press.answer(answer),
});
const watch = new WatchNotice();
const press = new PressPanel((command) => connection.send(command), planes.canvases);

function openSurface() {
  try {
    return new Surface(element("surface"), planes.imageCanvas, () => { turned = true; });
  } catch (error) {
    console.info(`no WebGL, so the surface is drawn in 2D: ${error.message}`);
    element("detail").disabled = true;
    return null;
  }
}

function firstLevel() {
  if (!surface) return RELIEF;
  return surface.software ? 1 : 0;
}

async function receive(buffer) {
  const view = await decoder.decode(buffer);
  if (waiting) {
    waiting.bitmap.close();
    connection.grant(1);
  }
  waiting = view;
}

function takeStatus(status) {
  // The smallest difference ever seen is the one least delayed on its way.
  clockOffsetS = Math.min(clockOffsetS, performance.now() / 1000 - status.now_s);
  stats.fps = status.fps ?? null;
  stats.error = status.error ?? null;
  showStatus(status);
  press.show(status.stage);
  watch.show(status.watch);
}

function turn(now) {
  requestAnimationFrame(turn);
  if (drewAt !== null && detail.note(now - drewAt)) turned = true;
  drewAt = null;
  if (waiting) {
    const view = waiting;
    waiting = null;
    draw(view);
    connection.grant(1);
    drewAt = now;
  } else if (turned && shown) {
    drawSurface();
  }
  turned = false;
}

function draw(view) {
  shown = view;
  planes.draw(view);
  view.bitmap.close();
  surface?.update(view, planes.normalPixels);
  drawSurface();
  ring.show(view.header.light);
  press.learn(view.header);
  history.add(view.header.time_s, view.header.contact.indentation_mm);
  history.draw(planes.scaleUm);
  count(view.header);
}

function drawSurface() {
  const flat = detail.level === RELIEF;
  relief.canvas.hidden = !flat;
  if (surface) surface.canvas.hidden = flat;
  if (flat) relief.draw(shown, planes.depthPixels, Number(element("exaggeration").value));
  else surface.draw(detail.level);
  stats.level = LEVELS[detail.level].name;
}

function count({ sequence, contact }) {
  if (sequence !== stats.sequence) drawnTimes.push(performance.now());
  Object.assign(stats, contact, { sequence, drawn: stats.drawn + 1 });
}

function tick() {
  const now = performance.now();
  drawnTimes = drawnTimes.filter((time) => now - time < FPS_WINDOW_MS);
  stats.drawn_fps = drawnTimes.length / (FPS_WINDOW_MS / 1000);
  element("drawn-fps").textContent = stats.drawn_fps.toFixed(1);
  element("level").textContent = LEVELS[detail.level].caption;
  if (shown) showContact(shown.header.contact);
  if (stats.state !== "lost") judgeAge(now);
}

function judgeAge(now) {
  if (!shown || clockOffsetS === Infinity) return;
  const ageS = Math.max(now / 1000 - clockOffsetS - shown.header.time_s, 0);
  stats.age_ms = ageS * 1000;
  setState(ageS > STALE_S ? "stale" : "live", ageS);
}

function setState(state, ageS = 0) {
  stats.state = state;
  document.body.dataset.state = state;
  const texts = { connected: "connected", live: "live", stale: `no frame ${ageS.toFixed(1)} s`, lost: "reconnecting" };
  element("state").textContent = texts[state];
}

function listen(id, act) {
  element(id).addEventListener("change", (event) => {
    act(event.target.value);
    turned = true;
  });
}

fillScales(element("scale"), planes.scaleUm);
listen("scale", (um) => {
  planes.setScale(Number(um));
  history.draw(planes.scaleUm);
  if (surface) surface.scaleUm = Number(um);
});
listen("gain", (gain) => planes.setGain(Number(gain)));
listen("exaggeration", (times) => { if (surface) surface.exaggeration = Number(times); });
listen("surface-colour", (mode) => { if (surface) surface.colouring = Number(mode); });
listen("detail", (level) => detail.choose(level === "auto" ? null : Number(level)));

requestAnimationFrame(turn);
setInterval(tick, 100);
