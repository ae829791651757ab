// What the wizard shows: one template of the routine's state and of what the visitor has chosen.

import { placeCells, slopeSectors } from "./charts.js";
import { html, nothing, repeat } from "./dom.js";
import { NAMES, advice, figureRows, instruction, presetNote } from "./wizard_texts.js";

const MARKS = { ready: "✓", missing: "✗", yours: "○" };
const MEANINGS = { ready: "ready", missing: "missing", yours: "for you to see to" };
const VIEW_TITLE =
  "the view.json that `gellight calibrate view` wrote: the part of the picture that is gel, seen straight";
const ENDS = ["finished", "aborted", "failed"];

export const isRunning = (routine) => Boolean(routine) && !ENDS.includes(routine.step);

/**
 * Return the page. `state` is the server's, null until it has told it; `visitor`: {picture, kind, like, anew, refusal,
 * error}; `losses` are [[epoch, loss], ...]; `picture`: {title, editable}; `does`: what the controls call.
 */
export function page(state, visitor, losses, picture, does) {
  const routine = state?.routine;
  const heldOut = routine?.figures?.presses?.held_out ?? [];
  return html`
    <header>
      <img src="favicon.svg" alt="" width="26" height="26">
      <h1>Calibration</h1>
      <span id="sensor" class="mono dim" data-testid="sensor">${state?.sensor}</span>
      <a class="link" href="./" data-testid="back">Live view</a>
    </header>
    <p id="error" class="error" data-testid="error" role="alert">${visitor.error}</p>
    <main>
      <ol id="steps" class="steps" data-testid="steps">${steps(routine)}</ol>
      <section class="panel picture">
        <h2 id="picture-title">${picture.title}</h2>
        <div class="controls"><label>show ${pictureChoice(routine, visitor.picture, does)}</label></div>
        <div class="frame"><canvas id="picture" data-testid="picture" width="640" height="480"></canvas></div>
        <p class="hint" id="circle-hint" data-testid="circle-hint" ?hidden=${!picture.editable}>
          Drag the middle of the circle to move it, its rim to change its size.</p>
      </section>
      <div class="side">
        <section class="panel guide">${state && guide(state, visitor, does)}</section>
        ${routine?.verdict ? verdict(routine, state.in_service) : nothing}
        ${routine?.figures?.presses ? coverage(routine.figures.presses) : nothing}
        ${heldOut.length > 1 ? errorChart(routine.figures.presses) : nothing}
        ${losses.length > 1 ? chart("loss", "Training loss", "", losses.at(-1)[1].toPrecision(3)) : nothing}
        ${figures(figureRows(routine?.figures ?? {}))}
      </div>
      <section class="panel bundles">
        <h2>Bundles of this sensor</h2>
        <table id="bundles" data-testid="bundles"><tbody>${state && bundles(state, does)}</tbody></table>
      </section>
    </main>`;
}

function steps(routine) {
  const all = routine?.steps ?? Object.keys(NAMES.step).map((name) => ({ name, state: "to do" }));
  return all.map(({ name, state }) => {
    const title = NAMES.step[name] ?? name;
    return html`<li class=${state.replace(" ", "-")} title="${title}: ${state}"
      aria-current=${state === "now" ? "step" : nothing}><span>${title}</span></li>`;
  });
}

function pictureChoice(routine, chosen, does) {
  const names = ["live", ...(routine?.pictures ?? []).filter((name) => name !== "live")];
  const option = (name, text) => html`<option value=${name} .selected=${name === chosen}>${text}</option>`;
  return html`<select id="which" data-testid="which" @change=${(event) => does.choose({ picture: event.target.value })}>
    ${option("auto", "what matters")}${names.map((name) => option(name, NAMES.picture[name] ?? name))}</select>`;
}

function guide(state, visitor, does) {
  const { routine } = state;
  const running = isRunning(routine);
  const { done, wanted, unit } = routine?.progress ?? {};
  const preset = running ? null : state.presets.find(({ name }) => name === visitor.kind);
  const prepared = preparation(state, visitor);
  return html`
    <p class="instruction" data-testid="instruction" role="status">${instruction(state, routine, running)}</p>
    <p class="advice" data-testid="advice">${advice(state, routine, running)}</p>
    <p class="problem" data-testid="problem" role="alert">${routine?.problem || visitor.refusal}</p>
    ${!running || done === undefined ? nothing : html`<div class="progress">
      <progress data-testid="bar" max=${wanted} value=${done}></progress>
      <output class="mono" data-testid="done">${done} of ${wanted} ${unit}</output></div>`}
    ${running || routine?.step === "finished" || !state.needs.length ? nothing : needs(state.needs)}
    ${request(state, running, visitor, preset, does)}
    ${running || !prepared ? nothing : html`<p class="hint" data-testid="picture-note">Of each picture ${prepared};
      the calibration keeps that.</p>`}
    ${preset ? html`<p class="hint" data-testid="kind-note">${presetNote(preset)}</p>` : nothing}
    <div id="actions" class="actions" data-testid="actions">${actions(state, running, does)}</div>`;
}

const goesOn = (state, visitor) => state.interrupted && !visitor.anew;

/** How pictures are prepared already, in words; a calibration that is gone on with keeps its own. */
function preparation(state, visitor) {
  return goesOn(state, visitor) ? state.interrupted_picture : state.picture;
}

/** The check list before the start: what is ready, what is missing, what only the visitor can see to. */
function needs(all) {
  return html`<ul class="needs" data-testid="needs" aria-label="what a calibration needs">
    ${all.map(({ name, state, text }) => html`<li class=${state}><span class="mark" role="img"
      aria-label=${MEANINGS[state]}>${MARKS[state]}</span><strong>${name}</strong><span>${text}</span></li>`)}</ul>`;
}

function request(state, running, visitor, preset, does) {
  const { defaults, simulated, interrupted } = state;
  const asItIs = simulated || goesOn(state, visitor) || Boolean(preparation(state, visitor)); // no view can be chosen
  const begin = (event) => { event.preventDefault(); does.act("begin"); };
  return html`<form id="request" class="request" data-testid="request" ?hidden=${running} @submit=${begin}>
    ${number("ball", "ball radius", "mm", 0.1, 100, preset?.ball_radius_mm ?? defaults.ball_radius_mm)}
    ${number("cylinder", "cylinder diameter", "mm", 0.1, 100, defaults.cylinder_diameter_mm)}
    <label ?hidden=${simulated || interrupted}>kind of sensor <select data-testid="kind"
      @change=${(event) => does.choose({ kind: event.target.value })}><option value="">GelLight, home-made</option>
      ${state.presets.map(({ name, title }) => html`<option value=${name}>${title}</option>`)}</select></label>
    <label>pixel size, if known <span><input id="pixel" data-testid="pixel" type="number" step="any" min="0.001" max="1"
      placeholder="cylinder" title="size of a pixel on the gel; empty where the cylinder is to measure it"
      .value=${defaults.pixel_size_mm ?? ""}> mm</span></label>
    ${number("presses", "ball presses", "", 2, 400, defaults.presses, 1)}
    ${likeUnit(state, visitor.like, does)}
    <label ?hidden=${!simulated}><span><input id="hand" data-testid="hand" type="checkbox" .checked=${defaults.hand}>
      a virtual hand presses</span></label>
    <label ?hidden=${!interrupted}><span><input data-testid="anew" type="checkbox"
      @change=${({ target }) => does.choose({ anew: target.checked })}> forget the interrupted
      calibration</span></label>
    <label id="view-row" class="whole" ?hidden=${asItIs}>view, if the picture shows more than gel <span>
      <input id="view" data-testid="view" type="file" accept=".json,application/json" title=${VIEW_TITLE}
        @change=${does.noteView}>
      <button id="no-view" data-testid="no-view" type="button" hidden @click=${does.forgetView}>take the whole
        picture</button>
    </span></label>
    <label id="dots-row" class="whole" ?hidden=${asItIs}><span><input id="dots" data-testid="dots" type="checkbox">
      the gel has marker dots; nothing may touch it when you start</span></label></form>`;
}

function number(id, name, unit, min, max, value, step = "any") {
  return html`<label>${name} <span><input id=${id} data-testid=${id} type="number" step=${step} min=${min} max=${max}
    required .value=${value}> ${unit}</span></label>`;
}

/** The units whose presses a calibration can begin with. */
function likeUnit({ units, interrupted }, chosen, does) {
  const option = (text, identity) => html`<option value=${identity} .selected=${identity === chosen}>${text}</option>`;
  const known = ({ name, sensor, created, identity }) =>
    option(`${name || sensor}, ${new Date(created).toLocaleDateString()}`, identity);
  return html`<label ?hidden=${!units.length}>like unit, if any <span><select data-testid="like"
    title="a unit of the same make, whose presses are begun with: two ball presses of this one are then enough"
    @change=${(event) => does.choose({ like: event.target.value })}>
    ${option(interrupted ? "as it was begun" : "none", "")}${units.map(known)}</select></span></label>`;
}

/** After a calibration everybody wants to see the live view; a button that is being pressed stays where it is. */
function actions({ routine, interrupted }, running, does) {
  const done = routine?.step === "finished" && routine.verdict?.passed !== false;
  const names = running ? routine.actions.filter((name) => name !== "correct") : done ? ["live", "begin"] : ["begin"];
  const begin = interrupted ? "Go on" : routine ? "Calibrate again" : "Start the calibration";
  return repeat(names, (name) => name, (name, place) => (name === "live"
    ? html`<a class="link first" href="./" data-testid="action-live">Live view</a>`
    : html`<button class="${name} ${place === 0 && name !== "abort" ? "first" : ""}" data-testid="action-${name}"
        @click=${() => does.act(name)}>${name === "begin" ? begin : NAMES.action[name] ?? name}</button>`));
}

function verdict({ step, verdict: { passed, text } }, inService) {
  const service = passed && step === "finished" ? `in service: ${inService}` : "";
  return html`<section class="panel verdict" id="verdict-panel">
    <h2>Verdict</h2>
    <p class="verdict-text ${passed ? "passed" : "failed"}" data-testid="verdict">${text}</p>
    <p class="dim mono" id="bundle" data-testid="bundle">${service}</p>
  </section>`;
}

function coverage({ coverage: { places, slopes, steepness_deg: steepness, steepest_deg: steepest } }) {
  const empty = places.flat().filter((count) => count === 0).length; // the same places that the advice counts
  const are = empty === 0 ? "none is empty" : `${empty} of ${places.flat().length} are empty`;
  return html`<section class="panel coverage">
    <h2>Coverage <span class="dim" data-testid="steepest">${steepest ? `up to ${steepest}°` : ""}</span></h2>
    <div class="maps">
      <figure><svg data-testid="places" viewBox="0 0 ${places[0].length * 10} ${places.length * 10}" role="img"
        aria-label="presses by place">${placeCells(places)}</svg>
        <figcaption data-testid="places-note">presses that reached each place; ${are}</figcaption></figure>
      <figure><svg data-testid="slopes" viewBox="-52 -52 104 104" role="img"
        aria-label="pixels by slope">${slopes ? slopeSectors(slopes, steepness) : nothing}</svg>
        <figcaption>slopes by direction, steep ones outside</figcaption></figure>
    </div>
  </section>`;
}

function errorChart({ held_out: points, held_out_um: shape }) {
  const now = `${points.at(-1)[1].toFixed(2)}°${shape == null ? "" : `, ${shape.toFixed(0)} µm`}`;
  return chart("held-out", "Error on presses not learnt", "degrees", now);
}

/** A chart, which is drawn once it has its size, with its newest figure. */
function chart(id, title, unit, now) {
  return html`<section class="panel chart" id="${id}-panel">
    <h2>${title} <span class="dim">${unit}</span> <span class="now" data-testid="${id}-now">${now}</span></h2>
    <svg id=${id} data-testid=${id} role="img" aria-label=${title}></svg>
  </section>`;
}

function figures(rows) {
  return rows.length === 0 ? nothing : html`<section class="panel figures-panel">
    <h2>Figures</h2>
    <table data-testid="figures"><tbody>
      ${rows.map(([name, value]) => html`<tr><td class="dim">${name}</td><td>${value}</td></tr>`)}</tbody></table>
  </section>`;
}

function bundles(state, does) {
  const none = "none yet; the sensor runs with the bundle it was started with";
  if (!state.bundles.length) return html`<tr><td class="dim">${none}</td></tr>`;
  const row = (bundle) => bundleRow(bundle, isRunning(state.routine), does);
  return repeat(state.bundles.toReversed(), ({ identity }) => identity, row);
}

function bundleRow({ identity, created, problem, report, in_service: inService }, running, does) {
  const restore = html`<button ?disabled=${running} data-testid="restore-${identity}"
    @click=${() => does.restore(identity)}>Restore</button>`;
  return html`<tr><td class="mono">${identity}</td>
    <td class=${problem ? "problem" : "dim"}>${created ? new Date(created).toLocaleString() : problem}</td>
    <td>${report && !problem ? html`<a class="report" href="calibration/report/${identity}" target="_blank"
      data-testid="report-${identity}">Report</a>` : nothing}${inService ? html`<span class="passed">in service</span>`
      : problem ? nothing : restore}</td></tr>`;
}
