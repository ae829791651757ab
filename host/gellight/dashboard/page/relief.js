// The surface where 3D is too slow or missing: depth colours shaded by the normals, as on a map.

const KEY = [-0.5, -0.6, 0.62]; // from the upper left

export class Relief {
  #context;
  #pixels = null;

  constructor(box) {
    this.canvas = document.createElement("canvas");
    this.canvas.className = "relief";
    box.append(this.canvas);
    this.#context = this.canvas.getContext("2d");
  }

  /** Shade `colours` (packed RGBA) by the normals of `view`, slopes made `exaggeration` times as steep. */
  draw(view, colours, exaggeration) {
    if (this.#pixels?.width !== view.width || this.#pixels.height !== view.height) {
      Object.assign(this.canvas, { width: view.width, height: view.height });
      this.#pixels = new ImageData(view.width, view.height);
    }
    const { data } = this.#pixels;
    for (let i = 0; i < colours.length; i++) {
      const light = 0.45 + 0.85 * brightness(view.normal[2 * i] / 127, view.normal[2 * i + 1] / 127, exaggeration);
      const colour = colours[i];
      data[4 * i] = (colour & 255) * light;
      data[4 * i + 1] = ((colour >> 8) & 255) * light;
      data[4 * i + 2] = ((colour >> 16) & 255) * light;
      data[4 * i + 3] = 255;
    }
    this.#context.putImageData(this.#pixels, 0, 0);
  }
}

function brightness(x, y, exaggeration) {
  const z = Math.sqrt(Math.max(1 - x * x - y * y, 0.01));
  const [a, b] = [x * exaggeration, y * exaggeration];
  return Math.max((a * KEY[0] + b * KEY[1] + z * KEY[2]) / Math.hypot(a, b, z), 0);
}
