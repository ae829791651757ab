// The last minutes of frames, as they came: dense where they are new, thinned out where they are old, never more bytes
// than the bound.

import { clamp } from "./hand.js";

const MOST_BYTES = 64e6;
const LEAST_GAP_S = 0.05;

export class Recent {
  bytes = 0;
  frames = []; // {timeS, buffer, peakMm}, oldest first; the peak is that of forgotten frames after it too
  #mostBytes;

  constructor(mostBytes = MOST_BYTES) {
    this.#mostBytes = mostBytes;
  }

  get count() {
    return this.frames.length;
  }

  /** Keep the message `buffer` of a frame taken at `timeS`, and its indentation; forget what has become too much. */
  add(timeS, buffer, peakMm) {
    const last = this.frames.at(-1);
    if (last?.timeS > timeS) [this.frames, this.bytes] = [[], 0]; // the sensor's clock was restarted
    else if (timeS - last?.timeS < LEAST_GAP_S) return raise(last, peakMm);
    this.frames.push({ timeS, buffer, peakMm });
    this.bytes += buffer.byteLength;
    while (this.bytes > this.#mostBytes && this.frames.length > 2) this.#thin();
  }

  /** Return the frame nearest to `timeS`; null where there is none. */
  nearest(timeS) {
    const distance = (frame) => Math.abs(frame.timeS - timeS);
    const nearer = (best, frame) => (best === null || distance(frame) < distance(best) ? frame : best);
    return this.frames.reduce(nearer, null);
  }

  /** Return the frame `count` frames after the one nearest to `timeS`, or before it; the first or last at the ends. */
  step(timeS, count) {
    const place = this.frames.indexOf(this.nearest(timeS)) + count;
    return this.frames[clamp(place, 0, this.frames.length - 1)] ?? null;
  }

  /** Forget the frame whose neighbours are nearest to each other, measured by how long ago it was. */
  #thin() {
    const now = this.frames.at(-1).timeS;
    const gap = (i) => (this.frames[i + 1].timeS - this.frames[i - 1].timeS) / (now - this.frames[i].timeS + 1);
    let least = 1;
    for (let i = 2; i < this.frames.length - 1; i++) if (gap(i) < gap(least)) least = i;
    const [forgotten] = this.frames.splice(least, 1);
    this.bytes -= forgotten.buffer.byteLength;
    raise(this.frames[least - 1], forgotten.peakMm);
  }
}

function raise(frame, peakMm) {
  if (peakMm > frame.peakMm) frame.peakMm = peakMm;
}
