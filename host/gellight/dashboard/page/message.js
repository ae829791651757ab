// The binary message of one tactile frame; messages.py on the server describes every byte.

import { ask } from "./command.js";
import { pitchMm } from "./field.js";
import { inflate, slopesOf, unpackDepth, unpackPicture } from "./packed.js";

const MAGIC = 0x464c4547; // "GELF", little-endian
const VERSION = 2;
const PREFIX_BYTES = 12;

/** Turns messages into views, in the order in which they came. */
export class Decoder {
  #reference = { name: "", picture: null }; // the image behind the difference images, null until it has been fetched
  #completed;
  #last = Promise.resolve();

  /** `completed()` is called when a reference image has come that views were returned without. */
  constructor(completed) {
    this.#completed = completed;
  }

  /**
   * Return a promise of the view of a message:
   * {header, width, height, image, reference, slopes, depth, contact, truth}. `image` is the camera image and
   * `reference.picture` that of the untouched gel, null until it is there. `slopes` is (h, w, 2) d(depth)/dx and
   * d(depth)/dy. `depth` holds codes, and so does `truth`, the true depth map; it is null where the sensor is not
   * simulated. `contact` has one bit a pixel.
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
    const [image, depth, contact, truth] = await Promise.all([
      unpackPicture(new Blob([plane("image")], { type: "image/jpeg" })),
      depths("depth"),
      inflate(plane("contact")),
      header.truth ? depths("truth") : null,
    ]);
    const slopes = slopesOf(depth, width, height, pitchMm({ header, width, height }));
    if (header.reference !== this.#reference.name) this.#fetch(header.reference);
    return { header, width, height, image, reference: this.#reference, depth, contact, truth, slopes };
  }

  async #fetch(name) {
    const reference = { name, picture: null };
    this.#reference = reference;
    const refusal = await ask(`reference/${name}`, async (answer) => {
      reference.picture = await unpackPicture(await answer.blob());
    });
    if (refusal) reference.name = ""; // the next frame asks again
    else this.#completed();
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
