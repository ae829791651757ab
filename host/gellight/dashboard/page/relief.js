// The surface where 3D is too slow or missing: depth colours shaded by the slopes, as on a map.

import { node } from "./dom.js";
import { rgb } from "./planes.js";

export class Relief {
  #context;
  #pixels = null;
  #words = null;

  constructor(box) {
    this.canvas = node("canvas", "", "relief");
    box.append(this.canvas);
    this.#context = this.canvas.getContext("2d");
  }

  /** Shade `colours` (packed RGBA) by the slopes of `view`, made `exaggeration` times as steep. */
  draw(view, colours, exaggeration) {
    if (this.#pixels?.width !== view.width || this.#pixels.height !== view.height) {
      Object.assign(this.canvas, { width: view.width, height: view.height });
      this.#pixels = new ImageData(view.width, view.height);
      this.#words = new Uint32Array(this.#pixels.data.buffer);
    }
    const { slopes } = view;
    for (let i = 0; i < colours.length; i++) {
      const light = 0.45 + 0.85 * brightness(exaggeration * slopes[2 * i], exaggeration * slopes[2 * i + 1]);
      const colour = colours[i];
      this.#words[i] = rgb(level((colour & 255) * light), level(((colour >> 8) & 255) * light), level(((colour >> 16) & 255) * light));
    }
    this.#context.putImageData(this.#pixels, 0, 0);
  }
}

const level = (grey) => Math.min(grey + 0.5, 255);

/** Light from the upper left, (-0.5, -0.6, 0.62), on a surface with slopes x and y: its normal is (-x, -y, 1) / length. */
function brightness(x, y) {
  return Math.max((0.62 + 0.5 * x + 0.6 * y) / Math.sqrt(x * x + y * y + 1), 0);
}
