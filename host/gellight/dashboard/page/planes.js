// The flat pictures: camera image, difference, normals, measured and true depth, and the relief, a flat surface.

import { chooseMap, depthColour, depthTable, rgb } from "./colour.js";
import { element, html, render } from "./dom.js";
import { subtract } from "./packed.js";

const OUTLINE = 0xffffffff;

/** A canvas at view size with its pixels at hand. */
class Plane {
  constructor(id) {
    this.canvas = element(id);
    this.context = this.canvas.getContext("2d");
    this.fit({ width: 320, height: 240 });
  }

  fit({ width, height }) {
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
  image = new Plane("image");
  difference = new Plane("difference");
  normal = new Plane("normal");
  depth = new Plane("depth");
  truth = new Plane("truth");
  relief = new Plane("relief");
  #view = null;
  #scaleUm = 0;
  #gain = 1;
  #colours = null; // of each depth code

  /** Show `view`; its true depth map where a simulated sensor knows it. */
  draw(view) {
    this.#view = view;
    for (const plane of [this.image, this.difference, this.normal, this.depth, this.truth]) plane.fit(view);
    this.image.context.putImageData(view.image, 0, 0);
    this.drawDifference();
    this.#drawNormals(view.slopes);
    this.#drawDepth();
  }

  /** Show the difference image, as soon as the reference image is there. */
  drawDifference() {
    if (!this.#view?.reference.picture) return;
    subtract(this.#view, this.#gain, this.difference.pixels.data);
    this.difference.show();
  }

  setGain(gain) {
    this.#gain = gain;
    this.drawDifference();
  }

  /** Show depth in one of the sets of colours. */
  setMap(name) {
    chooseMap(name);
    this.setScale(this.#scaleUm);
  }

  setScale(scaleUm) {
    this.#scaleUm = scaleUm;
    this.#colours = depthTable(scaleUm);
    drawBar(scaleUm);
    this.#drawDepth();
  }

  /** Shade the depth by the slopes, `exaggeration` times as steep, as on a map: where 3D is too slow or missing. */
  drawRelief(exaggeration) {
    this.relief.fit(this.#view);
    const { slopes } = this.#view;
    const { words } = this.relief;
    for (let i = 0; i < words.length; i++) {
      const light = 0.45 + 0.85 * brightness(exaggeration * slopes[2 * i], exaggeration * slopes[2 * i + 1]);
      const lit = (shift) => Math.min(((this.depth.words[i] >> shift) & 255) * light + 0.5, 255);
      words[i] = rgb(lit(0), lit(8), lit(16));
    }
    this.relief.show();
  }

  #drawNormals(slopes) {
    const { words } = this.normal;
    for (let i = 0; i < words.length; i++) {
      const x = slopes[2 * i];
      const y = slopes[2 * i + 1];
      const z = 127.5 / Math.sqrt(x * x + y * y + 1);
      words[i] = rgb(128 - x * z, 128 - y * z, 128 + z);
    }
    this.normal.show();
  }

  #drawDepth() {
    if (!this.#view) return;
    const { depth, truth, contact, width, height } = this.#view;
    this.#paint(this.depth, depth);
    outline(this.depth.words, contact, width, height);
    this.depth.show();
    element("truth-panel").hidden = !truth;
    document.body.classList.toggle("has-truth", Boolean(truth));
    if (!truth) return;
    this.#paint(this.truth, truth);
    this.truth.show();
  }

  #paint({ words }, codes) {
    for (let i = 0; i < words.length; i++) words[i] = this.#colours[codes[i]];
  }
}

/** Light from the upper left, (-0.5, -0.6, 0.62), on a surface with slopes x and y and the normal (-x, -y, 1). */
function brightness(x, y) {
  return Math.max((0.62 + 0.5 * x + 0.6 * y) / Math.sqrt(x * x + y * y + 1), 0);
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
  const context = element("bar").getContext("2d");
  for (let column = 0; column < 256; column++) {
    context.fillStyle = `rgb(${depthColour(column / 255)})`;
    context.fillRect(column, 0, 1, 1);
  }
  render([0, 0.5, 1].map((part) => html`<li>${scaleUm * part} µm</li>`), element("ticks"));
}
