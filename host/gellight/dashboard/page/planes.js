// The four flat pictures: camera image, difference, normals, depth.

import { DEPTH_SCALES_UM, MAPS, chooseMap, depthColour, depthTable, differenceTable } from "./colour.js";
import { element, node } from "./dom.js";

const OUTLINE = 0xffffffff;
const OPAQUE = 0xff000000;

/** A canvas at view size with its pixels at hand. */
class Plane {
  constructor(id) {
    this.canvas = element(id);
    this.context = this.canvas.getContext("2d");
    this.fit(320, 240);
  }

  fit(width, height) {
    if (this.pixels?.width === width && this.pixels.height === height) return;
    Object.assign(this.canvas, { width, height });
    this.pixels = new ImageData(width, height);
    this.pixels.data.fill(255);
    this.words = new Uint32Array(this.pixels.data.buffer);
  }

  show() {
    this.context.putImageData(this.pixels, 0, 0);
  }
}

export class Planes {
  #image = new Plane("image");
  #difference = new Plane("difference");
  #normal = new Plane("normal");
  #depth = new Plane("depth");
  #view = null;

  constructor() {
    this.setGain(2);
    this.setScale(1600);
  }

  /** Show `view`. */
  draw(view) {
    this.#view = view;
    for (const plane of [this.#image, this.#difference, this.#normal, this.#depth]) plane.fit(view.width, view.height);
    this.#image.context.drawImage(view.bitmap, 0, 0);
    this.#drawDifference(view.difference);
    this.#drawNormals(view.slopes);
    this.#drawDepth(view);
  }

  /** Show the difference image of `view`, which was not known when the rest was drawn. */
  complete(view) {
    if (view === this.#view) this.#drawDifference(view.difference);
  }

  get canvases() {
    return [this.#image, this.#difference, this.#normal, this.#depth].map((plane) => plane.canvas);
  }

  get imageCanvas() {
    return this.#image.canvas;
  }

  get normalPixels() {
    return this.#normal.pixels.data;
  }

  get depthPixels() {
    return this.#depth.words;
  }

  setGain(gain) {
    this.differences = differenceTable(gain);
    if (this.#view) this.#drawDifference(this.#view.difference);
  }

  /** Show depth in the colours of one of `MAPS`. */
  setMap(name) {
    chooseMap(name);
    this.setScale(this.scaleUm);
  }

  setScale(scaleUm) {
    this.scaleUm = scaleUm;
    this.colours = depthTable(scaleUm);
    drawBar(scaleUm);
    if (this.#view) this.#drawDepth(this.#view);
  }

  #drawDifference(difference) {
    if (!difference) return;
    const { data } = this.#difference.pixels;
    for (let from = 0, to = 0; from < difference.length; from += 3, to += 4) {
      data[to] = this.differences[difference[from]];
      data[to + 1] = this.differences[difference[from + 1]];
      data[to + 2] = this.differences[difference[from + 2]];
    }
    this.#difference.show();
  }

  #drawNormals(slopes) {
    const { words } = this.#normal;
    for (let i = 0; i < words.length; i++) {
      const x = slopes[2 * i];
      const y = slopes[2 * i + 1];
      const z = 127.5 / Math.sqrt(x * x + y * y + 1);
      words[i] = rgb(128 - x * z, 128 - y * z, 128 + z);
    }
    this.#normal.show();
  }

  #drawDepth({ depth, contact, width, height }) {
    const { words } = this.#depth;
    for (let i = 0; i < depth.length; i++) words[i] = this.colours[depth[i]];
    outline(words, contact, width, height);
    this.#depth.show();
  }
}

/** Return an opaque pixel of three levels from 0 to below 256, each cut to a whole number. */
export function rgb(red, green, blue) {
  return OPAQUE | (blue << 16) | (green << 8) | red;
}

/** Draw the rim of the contact patch: pixels inside it with a neighbour outside. */
function outline(words, contact, width, height) {
  const inside = (i) => (contact[i >> 3] >> (7 - (i & 7))) & 1;
  for (let row = 1; row < height - 1; row++) {
    for (let i = row * width + 1; i < (row + 1) * width - 1; i++) {
      if (inside(i) && !(inside(i - 1) && inside(i + 1) && inside(i - width) && inside(i + width))) words[i] = OUTLINE;
    }
  }
}

function drawBar(scaleUm) {
  const bar = element("bar");
  Object.assign(bar, { width: 256, height: 1 });
  const context = bar.getContext("2d");
  for (let column = 0; column < 256; column++) {
    context.fillStyle = `rgb(${depthColour(column / 255)})`;
    context.fillRect(column, 0, 1, 1);
  }
  element("ticks").replaceChildren(...[0, 0.5, 1].map((part) => node("li", `${scaleUm * part} µm`)));
}

/** Fill the chooser of the colours. */
export function fillMaps(select) {
  for (const name of Object.keys(MAPS)) select.add(new Option(name, name));
}

/** Fill the chooser of the depth scale. */
export function fillScales(select, chosen) {
  for (const um of DEPTH_SCALES_UM) select.add(new Option(`0 – ${um} µm`, um, um === chosen, um === chosen));
}
