// The reference images behind the difference images: fetched once by name, kept by the browser.

import { pixelsOf } from "./derived.js";

export class References {
  #name = "";
  #pixels = null;
  #waiting = () => {}; // the newest of those who wait

  /** Return the (h, w, 4) RGBA bytes of the reference image `name`; null until it has been fetched. */
  get(name) {
    if (name !== this.#name) {
      this.#name = name;
      this.#pixels = null;
      this.#fetch(name);
    }
    return this.#pixels;
  }

  /** Hand the image that is being fetched to `take`, instead of to who asked before. */
  whenFetched(take) {
    this.#waiting = take;
  }

  async #fetch(name) {
    try {
      const answer = await fetch(`reference/${name}`);
      if (!answer.ok) throw new Error(await answer.text());
      const bitmap = await createImageBitmap(await answer.blob(), { colorSpaceConversion: "none" });
      if (name !== this.#name) return;
      this.#pixels = pixelsOf(bitmap);
      this.#waiting(this.#pixels);
    } catch (error) {
      console.info(`no difference image for now: ${error.message}`);
      if (name === this.#name) this.#name = ""; // the next frame asks again
    }
  }
}
