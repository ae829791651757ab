// How finely the surface is drawn, by what this machine can afford.

export const LEVELS = [
  { name: "320 × 240 mesh", caption: "320 × 240 mesh, grid 5 mm", columns: 320, rows: 240 },
  { name: "160 × 120 mesh", caption: "160 × 120 mesh, grid 5 mm", columns: 160, rows: 120 },
  { name: "2D relief", caption: "2D relief", columns: 0, rows: 0 },
];
export const RELIEF = LEVELS.length - 1;

const BUDGET_MS = 130; // what a picture may take from being drawn to the next turn of the page
const SAMPLES = 5;
const SETTLING = 2; // the first pictures of a level compile shaders
const EASY_MS = 40; // a picture that takes less than that leaves time for a finer one
const EASY_PICTURES = 40; // as many easy pictures in a row before a finer level is tried, twice as many after each fall
const SPARSE = 4; // where pictures are easy at the finest level, one in SPARSE is timed
const PAUSE_MS = 3000; // longer than that the page was asleep, not slow

/** Steps down a level when the median picture takes longer than the budget, and up when there is time; `choose` overrides it. */
export class Detail {
  #first;
  #finest;
  #chosen = null;
  #times = [];
  #settling = SETTLING;
  #easy = 0; // easy pictures in a row
  #patience = EASY_PICTURES;
  #untimed = 0; // pictures since the last one that was timed
  why = ""; // the surface is drawn in 2D

  /** Start at level `first`, and never draw finer than `finest`. */
  constructor(first, finest = 0) {
    this.#first = first;
    this.#finest = finest;
    this.level = first;
  }

  /** What is drawn, for people; of the relief also why there is no 3D. */
  get caption() {
    const { caption } = LEVELS[this.level];
    return this.level === RELIEF && this.why ? `${caption}: ${this.why}` : caption;
  }

  /** Fix a level, or let it adapt again with null. */
  choose(level) {
    this.#chosen = level;
    this.why = "";
    this.#enter(level ?? this.#first);
  }

  /** Whether the next picture is to be timed: that takes a turn of the page, which composes all of it once more. */
  due() {
    if (this.#chosen !== null || this.#finest === RELIEF) return false;
    const calm = this.level === this.#finest && this.#easy > 0;
    this.#untimed = calm ? (this.#untimed + 1) % SPARSE : 0;
    return this.#untimed === 0;
  }

  /** Take in how long the last picture took; return whether the level has changed. */
  note(milliseconds) {
    if (this.#chosen !== null || milliseconds > PAUSE_MS) return false;
    if (this.#settling-- > 0) return false;
    return this.#fall(milliseconds) || this.#rise(milliseconds);
  }

  #fall(milliseconds) {
    if (this.level === RELIEF) return false;
    this.#times.push(milliseconds);
    if (this.#times.length < SAMPLES) return false;
    const median = this.#times.toSorted((a, b) => a - b)[SAMPLES >> 1];
    this.#times = [];
    if (median <= BUDGET_MS) return false;
    this.#patience *= 2;
    this.why = `in 3D a picture took ${median.toFixed(0)} ms`;
    this.#enter(this.level + 1);
    return true;
  }

  #rise(milliseconds) {
    this.#easy = milliseconds < EASY_MS ? this.#easy + 1 : 0;
    if (this.level <= this.#finest || this.#easy < this.#patience) return false;
    this.#enter(this.level - 1);
    return true;
  }

  #enter(level) {
    this.level = level;
    this.#times = [];
    this.#settling = SETTLING;
    this.#easy = 0;
  }
}
