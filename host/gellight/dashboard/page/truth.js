// The true depth map beside the measured one, where a simulated sensor knows it.

import { fixed } from "./figures.js";

const element = (id) => document.getElementById(id);

export class Truth {
  #pen = element("truth").getContext("2d");
  #pixels = null;

  /** Draw the truth of `view` by the table of colours of the measured depth; without one the panel is hidden. */
  draw(view, colours) {
    const known = Boolean(view.truth);
    element("truth-panel").hidden = !known;
    document.body.classList.toggle("has-truth", known);
    if (!known) return;
    if (this.#pixels?.width !== view.width || this.#pixels.height !== view.height) {
      Object.assign(element("truth"), { width: view.width, height: view.height });
      this.#pixels = new ImageData(view.width, view.height);
    }
    const words = new Uint32Array(this.#pixels.data.buffer);
    for (let i = 0; i < words.length; i++) words[i] = colours[view.truth[i]];
    this.#pen.putImageData(this.#pixels, 0, 0);
    const { indentation_mm: indentation, depth_error_mm: error } = view.header.truth;
    element("truth-error").textContent = `indentation ${fixed(indentation, 3)} mm · error ${fixed(error * 1000, 1)} µm`;
  }
}
