// The contacts of a frame, each with a number that it keeps while it moves.

import { fixed } from "./figures.js";

const FAR_MM = 3; // a contact further than that from all of the last frame is another one

export class Contacts {
  #body;
  #known = []; // {number, centroid_mm} of the last frame
  #text = "";

  /** Show them as rows of the table body `body`. */
  constructor(body) {
    this.#body = body;
  }

  /** Take in the contacts of a frame; return them with their numbers. */
  number(contacts) {
    const free = [...this.#known];
    const numbered = contacts.map((contact) => ({ ...contact, number: take(free, contact.centroid_mm) }));
    const used = new Set(numbered.map(({ number }) => number));
    let next = 1;
    for (const contact of numbered) {
      if (contact.number) continue;
      while (used.has(next)) next++;
      contact.number = next;
      used.add(next);
    }
    this.#known = numbered;
    return numbered.toSorted((a, b) => a.number - b.number);
  }

  /** Show numbered contacts. */
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

/** Take the nearest of `known` out of it and return its number; 0 where none is near. */
function take(known, [x, y]) {
  const distances = known.map(({ centroid_mm: at }) => Math.hypot(at[0] - x, at[1] - y));
  const least = Math.min(...distances);
  if (!(least <= FAR_MM)) return 0;
  return known.splice(distances.indexOf(least), 1)[0].number;
}
