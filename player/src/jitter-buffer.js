// Evens out when live frames come: each is shown a little after it could have been, at the pace of its timestamps.

/** Frames of delay. */
const FRAMES = 3;
/** Most frames held. */
const MOST = 12;
/** A timestamp that is off by more than this, in ms, begins a new timeline. */
const JUMP = 1000;
/** How much of a delay that proves too long is given back each frame. */
const CATCH_UP = 0.02;

/** @template {{ timestampNs: number }} Frame */
export class JitterBuffer {
  /** @type {Frame[]} in the order in which they are shown */
  #frames = [];
  /** Add it to a frame's time to have when it is due. @type {number | null} */
  #offset = null;
  #delay;

  /** @param {number} fps frames a second */
  constructor(fps) {
    this.#delay = (FRAMES * 1000) / fps;
  }

  get length() {
    return this.#frames.length;
  }

  clear() {
    this.#frames = [];
    this.#offset = null;
  }

  /** @param {Frame} frame @param {number} now ms */
  put(frame, now) {
    const time = frame.timestampNs / 1e6;
    const early = this.#offset === null ? Infinity : time + this.#offset - now;
    if (Math.abs(early) > JUMP) this.#offset = now + this.#delay - time;
    // Too late already: all that follows is shown later by as much.
    else if (early < 0) this.#offset = /** @type {number} */ (this.#offset) - early;
    else this.#offset = /** @type {number} */ (this.#offset) - CATCH_UP * (early - this.#delay);
    this.#frames.push(frame);
    if (this.#frames.length > MOST) this.#frames.shift();
  }

  /** The newest frame that is due; those before it are dropped. @param {number} now ms @returns {Frame | null} */
  take(now) {
    let due = null;
    while (this.#frames.length && this.#frames[0].timestampNs / 1e6 + (this.#offset ?? 0) <= now)
      due = this.#frames.shift() ?? null;
    return due;
  }
}
