// The calibration wizard: shows the state of the routine, and sends it what the visitor chose.

import { drawCurve } from "./charts.js";
import { CirclePicture } from "./circle.js";
import { SILENT, ask, command as order } from "./command.js";
import { element, render } from "./dom.js";
import { NAMES } from "./wizard_texts.js";
import { page } from "./wizard_view.js";

const POLL_MS = 300;
const MOST_VIEW_BYTES = 10000; // as the server takes

/** What the page knows, for scripts and tests. */
const stats = { state: null, picture: null, shown: 0, losses: [] };
window.wizard = stats;

const visitor = { picture: "auto", kind: "", like: "", anew: false, refusal: "", error: "" };
const does = {
  act: (name) => (name === "begin" ? begin() : command({ type: "act", action: name })),
  restore: (identity) => command({ type: "restore", identity }),
  choose: (chosen) => tell(chosen),
  noteView,
  forgetView: () => { element("view").value = ""; noteView(); },
};
const isOfPress = (name) => ["press", "difference"].includes(name);
const editable = (name, routine) => isOfPress(name) && Boolean(routine?.actions.includes("correct"));
show();
const correct = (circle) => command({ type: "act", action: "correct", ...circle });
const picture = new CirclePicture(element("picture"), correct);

async function poll() {
  if (!document.hidden) {
    const error = await ask("calibration", async (answer) => { stats.state = await answer.json(); });
    if (!error) noteLoss(stats.state.routine?.progress ?? {});
    tell({ error: error === SILENT ? `${SILENT}; it is asked again` : error });
    await showPicture();
  }
  setTimeout(poll, POLL_MS);
}

function noteLoss({ done, loss }) {
  if (loss !== undefined) stats.losses[done] = loss;
}

/** Show the page with what the visitor has now chosen, or is told. */
function tell(news) {
  Object.assign(visitor, news);
  show();
}

function show() {
  const routine = stats.state?.routine;
  document.body.dataset.step = routine?.step ?? "";
  const known = routine?.figures?.fit?.losses?.map((loss, epoch) => [epoch + 1, loss]);
  const losses = known ?? Object.entries(stats.losses).map(([epoch, loss]) => [Number(epoch), loss]);
  const title = NAMES.picture[stats.picture] ?? stats.picture ?? NAMES.picture.live;
  const shown = { title, editable: editable(stats.picture, routine) };
  render(page(stats.state, visitor, losses, shown, does), document.body);
  if (element("loss")) drawCurve(element("loss"), losses, "epoch");
  if (element("held-out")) drawCurve(element("held-out"), routine.figures.presses.held_out, "presses");
}

async function command(call) {
  tell({ refusal: await order(call) });
}

/** The view file that was chosen, as the server reads it; throws, in words, for one that cannot be a view. */
async function chosenView() {
  const [file] = element("view-row").hidden ? [] : element("view").files;
  if (!file) return null;
  const { name, size } = file;
  if (size <= MOST_VIEW_BYTES) return { name, content: await file.text() };
  const most = `a view has at most ${MOST_VIEW_BYTES}`;
  throw new Error(`${name} is no view (${size} bytes, ${most}): make it with \`gellight calibrate view\``);
}

/** Another file was chosen, or none: what was said of the last one no longer holds. */
function noteView() {
  element("no-view").hidden = element("view").files.length === 0;
  tell({ refusal: "" });
}

async function request() {
  return {
    view: await chosenView(),
    dots: element("dots").checked && !element("dots-row").hidden,
    ball_radius_mm: element("ball").valueAsNumber,
    cylinder_diameter_mm: element("cylinder").valueAsNumber,
    pixel_size_mm: element("pixel").value ? element("pixel").valueAsNumber : null,
    presses: element("presses").valueAsNumber,
    like: visitor.like,
    hand: element("hand").checked,
    anew: visitor.anew,
  };
}

async function begin() {
  if (!element("request").reportValidity()) return;
  stats.losses = [];
  try {
    await command({ type: "calibrate", request: await request() });
  } catch (error) {
    tell({ refusal: error.message });
  }
}

/** The picture that helps most now: the press that can still be corrected, else what is seen. */
function wanted() {
  if (visitor.picture !== "auto") return visitor.picture;
  const { step, press, pictures } = stats.state?.routine ?? {};
  if (press && ["presses", "verify"].includes(step)) {
    const shown = ["difference", "press"].find((name) => pictures.includes(name));
    if (shown) return shown;
  }
  return step === "finished" && pictures.includes("verify") ? "verify" : "live";
}

async function showPicture() {
  const name = wanted();
  const routine = stats.state?.routine;
  if (picture.dragging) return;
  const answer = await fetch(`calibration/picture/${name}`).catch(() => null);
  if (!answer?.ok) return;
  const image = await createImageBitmap(await answer.blob());
  picture.show(image, isOfPress(name) ? routine?.press : null, editable(name, routine));
  Object.assign(stats, { picture: name, shown: stats.shown + 1 });
  show();
}

poll();
