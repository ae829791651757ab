// The true depth map beside the measured one, where a simulated sensor knows it.

import { element, write } from "./dom.js";
import { fixed } from "./figures.js";

export class Truth {
  #pen = element("truth").getContext("2d");
  #pixels = null;
  #drawn = []; // the codes that are drawn, and the colours

  /** Draw the truth of `view` by the table of colours of the measured depth; without one the panel is hidden. */
  draw(view, colours) {
    const known = Boolean(view.truth);
    element("truth-panel").hidden = !known;
    document.body.classList.toggle("has-truth", known);
    if (!known || (view.truth === this.#drawn[0] && colours === this.#drawn[1])) return;
    this.#drawn = [view.truth, colours];
    if (this.#pixels?.width !== view.width || this.#pixels.height !== view.height) {
      Object.assign(element("truth"), { width: view.width, height: view.height });
      this.#pixels = new ImageData(view.width, view.height);
    }
    const words = new Uint32Array(this.#pixels.data.buffer);
    for (let i = 0; i < words.length; i++) words[i] = colours[view.truth[i]];
    this.#pen.putImageData(this.#pixels, 0, 0);
  }

  /** Show the figures of a frame's `truth`, if it has one. */
  write(truth) {
    if (!truth) return;
    write("truth-error", `indentation ${fixed(truth.indentation_mm, 3)} mm · error ${fixed(truth.depth_error_mm * 1000, 1)} µm`);
  }
}
