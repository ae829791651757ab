// The contacts of a frame as a table; the sensor numbers them, and each keeps its number while it lasts.

import { fixed } from "./figures.js";

export class Contacts {
  #body;
  #text = "";

  /** Show them as rows of the table body `body`. */
  constructor(body) {
    this.#body = body;
  }

  /** Show the contacts of a frame. */
  show(contacts) {
    const rows = contacts.map(({ number, depth_mm: depth, area_mm2: area, volume_mm3: volume, slope_rad: slope }) => [
      String(number), fixed(depth, 3), fixed(area, 2), fixed(volume, 2), fixed(slope === null ? null : (slope * 180) / Math.PI, 1),
    ]);
    const text = rows.join(";");
    if (text === this.#text) return;
    this.#text = text;
    this.#body.replaceChildren(...rows.map((cells) => {
      const row = document.createElement("tr");
      row.append(...cells.map((textContent) => Object.assign(document.createElement("td"), { textContent })));
      return row;
    }));
  }
}
