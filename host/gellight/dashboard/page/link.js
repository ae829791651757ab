// How far what the page shows lies behind the sensor, and whether the link or the sensor is to blame. Times in s.

const STATUS_PERIOD_S = 0.25; // as often the server tells its status

export class Link {
  #offsetS = Infinity; // page clock minus the server's clock, by the status that was least delayed
  #latenessS = 0;
  #heardS = null;

  /** Take in a status that said `serverS` on the server's clock and came at `nowS`. */
  note(nowS, serverS) {
    this.#offsetS = Math.min(this.#offsetS, nowS - serverS);
    this.#latenessS = nowS - serverS - this.#offsetS;
    this.#heardS = nowS;
  }

  /** Forget all: the server may be another one. */
  reset() {
    this.#offsetS = Infinity;
    this.#latenessS = 0;
    this.#heardS = null;
  }

  /** How far the link lies behind its best, or how long it has said nothing. */
  behindS(nowS) {
    if (this.#heardS === null) return 0;
    return Math.max(this.#latenessS, nowS - this.#heardS - STATUS_PERIOD_S, 0);
  }

  /** Age of a frame that was taken at `timeS` on the server's clock; null where the clocks are not compared yet. */
  ageS(nowS, timeS) {
    return this.#offsetS === Infinity ? null : Math.max(nowS - this.#offsetS - timeS, 0);
  }
}
