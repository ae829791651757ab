// The binary message of one tactile frame; messages.py on the server describes every byte.

import { pitchMm } from "./field.js";
import { differenceOf, inflate, pixelsOf, slopesOf, unpackDepth } from "./packed.js";

const MAGIC = 0x464c4547; // "GELF", little-endian
const VERSION = 2;
const PREFIX_BYTES = 12;

/** Turns messages into views, in the order in which they came. */
export class Decoder {
  #reference = { name: "", pixels: null }; // the image behind the difference images; the browser keeps what it fetched
  #newest = null; // {view, image}: whose difference is found when the reference has been fetched
  #truth = { packed: null, codes: null }; // the last one: it stays while an object rests
  #completed;
  #last = Promise.resolve();

  /** `completed(view)` is called when the difference of a view is known that was returned without. */
  constructor(completed) {
    this.#completed = completed;
  }

  /**
   * Return a promise of the view of a message:
   * {header, width, height, bitmap, difference, slopes, depth, contact, truth}. `bitmap` is the camera image; who draws
   * it closes it. `difference` is (h, w, 3) grey levels + 128; null until the reference image is there. `slopes` is
   * (h, w, 2) d(depth)/dx and d(depth)/dy. `depth` holds codes, and so does `truth`, the true depth map; it is null
   * where the sensor is not simulated. `contact` has one bit a pixel.
   */
  decode(buffer) {
    const view = this.#decode(buffer);
    const before = this.#last;
    this.#last = view.catch(() => null);
    return before.then(() => view);
  }

  async #decode(buffer) {
    const { header, plane } = parse(buffer);
    const [width, height] = header.view_px;
    const depths = async (name) => unpackDepth(await inflate(plane(name)), width, height);
    const [bitmap, depth, contact, truth] = await Promise.all([
      createImageBitmap(new Blob([plane("image")], { type: "image/jpeg" }), { colorSpaceConversion: "none" }),
      depths("depth"),
      inflate(plane("contact")),
      header.truth ? this.#truthOf(plane("truth"), () => depths("truth")) : null,
    ]);
    const slopes = slopesOf(depth, width, height, pitchMm({ header, width, height }));
    const view = { header, width, height, bitmap, depth, contact, truth, slopes, difference: null };
    this.#subtract(view, pixelsOf(bitmap));
    return view;
  }

  /** Return the codes of the true depth map; those of before where it has not changed. */
  #truthOf(packed, unpack) {
    if (!this.#truth.packed || !equal(packed, this.#truth.packed)) this.#truth = { packed, codes: unpack() };
    return this.#truth.codes;
  }

  #subtract(view, image) {
    const { reference: name } = view.header;
    this.#newest = { view, image };
    if (name !== this.#reference.name) this.#fetch(name);
    else if (this.#reference.pixels) this.#subtractNewest();
  }

  #subtractNewest() {
    const { view, image } = this.#newest;
    view.difference = differenceOf(image, this.#reference.pixels, view.header.light_drift);
  }

  async #fetch(name) {
    this.#reference = { name, pixels: null };
    try {
      const answer = await fetch(`reference/${name}`);
      if (!answer.ok) throw new Error(await answer.text());
      const bitmap = await createImageBitmap(await answer.blob(), { colorSpaceConversion: "none" });
      if (name !== this.#reference.name) return;
      this.#reference.pixels = pixelsOf(bitmap);
      this.#subtractNewest();
      this.#completed(this.#newest.view);
    } catch (error) {
      console.info(`no difference image for now: ${error.message}`);
      if (name === this.#reference.name) this.#reference.name = ""; // the next frame asks again
    }
  }
}

/** Return {header, plane}: `plane(name)` is the bytes of a plane. Throws where the message is not of this version. */
function parse(buffer) {
  const prefix = new DataView(buffer);
  if (prefix.getUint32(0, true) !== MAGIC || prefix.getUint32(4, true) !== VERSION) {
    throw new Error("the server speaks another version: reload this page");
  }
  const start = PREFIX_BYTES + prefix.getUint32(8, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, PREFIX_BYTES, start - PREFIX_BYTES)));
  const place = Object.fromEntries(header.planes.map((plane) => [plane.name, plane]));
  return { header, plane: (name) => new Uint8Array(buffer, start + place[name].offset, place[name].length) };
}

function equal(one, other) {
  return one.length === other.length && one.every((byte, i) => byte === other[i]);
}
