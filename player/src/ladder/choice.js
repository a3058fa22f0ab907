// Which rung of a ladder to play: by what the network gives and by how fast decoders are.

/** Part of the throughput that a rung may need to be begun, and to be kept. */
const BEGIN = 0.8;
const KEEP = 0.95;
/** Part of the decoders' time that a rung may need to be begun, and to be kept. */
const BEGIN_LOAD = 0.7;
const KEEP_LOAD = 0.95;
/** Weight of all earlier downloads beside the last one: what a network gave two segments ago says little. */
const EARLIER = 0.25;
/** Weight of a frame's time in the mean of its rung. */
const FRAME_WEIGHT = 0.1;
/** Frames of a rung after which their mean is believed: the first ones run code that is not yet optimised. */
const BELIEVED = 15;
/** Most frames that a rung's mean counts, and how many of them each frame of another rung takes back: machines become faster and slower. */
const REMEMBERED = 45;
const FORGOTTEN = 0.1;
/** Seconds after which a download is compared with one of a lower rung. */
const PATIENCE = 0.4;

export class Choice {
  /** Bits a second that the network gives; 0 until something was downloaded. */
  throughput = 0;
  /** The rung that is being downloaded; the lowest at first, for the first picture. */
  current;
  #bandwidths;
  /** Bits and seconds of downloads, weighted. */
  #measured = { bits: 0, seconds: 0 };
  /** Mean time of a frame by rung in ms, and how many there were. @type {{ ms: number, frames: number }[]} */
  #frames;

  /** @param {number[]} bandwidths of rungs in bits a second, the best first */
  constructor(bandwidths) {
    this.#bandwidths = bandwidths;
    this.current = bandwidths.length - 1;
    this.#frames = bandwidths.map(() => ({ ms: 0, frames: 0 }));
  }

  /** @param {number} bytes 0 if nothing came @param {number} seconds that it took */
  downloaded(bytes, seconds) {
    this.#measured.bits = EARLIER * this.#measured.bits + 8 * bytes;
    this.#measured.seconds = EARLIER * this.#measured.seconds + Math.max(seconds, 1e-3);
    this.throughput = this.#measured.bits / this.#measured.seconds;
  }

  /** @param {number} rung @param {number} ms that a frame took */
  decoded(rung, ms) {
    for (const other of this.#frames) other.frames = Math.max(0, other.frames - FORGOTTEN);
    const mean = this.#frames[rung];
    mean.frames = Math.min(REMEMBERED, mean.frames + 1 + FORGOTTEN);
    mean.ms += (ms - mean.ms) * Math.max(FRAME_WEIGHT, 1 / mean.frames);
  }

  /**
   * The rung to go on with.
   * @param {{ frameMs: number, workers: number, speed: number }} needs how long a frame is shown at speed 1
   * @returns {number}
   */
  next({ frameMs, workers, speed }) {
    const fits = (/** @type {number} */ rung) => {
      const keeps = rung >= this.current;
      const load = (this.#timeOf(rung) * speed) / (frameMs * workers);
      return (
        this.#bandwidths[rung] * speed <= this.throughput * (keeps ? KEEP : BEGIN) && load <= (keeps ? KEEP_LOAD : BEGIN_LOAD)
      );
    };
    const best = this.#bandwidths.findIndex((_, rung) => fits(rung));
    if (this.throughput > 0) this.current = best < 0 ? this.#bandwidths.length - 1 : best;
    return this.current;
  }

  /**
   * A lower rung that a download should be given up for: one that is there sooner, where the playhead would wait otherwise.
   * @param {{ rung: number, bytes: number, got: number, passed: number, ahead: number, seconds: number }} download bytes of the segment as far
   *   as is known, those that are there, seconds since it began, seconds until it is needed, and its duration
   * @returns {number | null}
   */
  instead({ rung, bytes, got, passed, ahead, seconds }) {
    if (passed < PATIENCE || rung === this.#bandwidths.length - 1) return null;
    const rate = Math.max(got, 1) / passed;
    const remaining = (bytes - got) / rate;
    if (remaining <= ahead) return null;
    const takes = (/** @type {number} */ lower) => (this.#bandwidths[lower] * seconds) / 8 / rate;
    const lower = this.#bandwidths.findIndex((_, lower) => lower > rung && takes(lower) <= Math.max(ahead, remaining / 2));
    return lower < 0 ? null : lower;
  }

  /** Milliseconds of a frame of a rung: measured, or guessed from the nearest lower one. @param {number} rung */
  #timeOf(rung) {
    const known = this.#frames.findIndex(({ frames }, at) => at >= rung && frames >= BELIEVED);
    if (known < 0) return 0;
    // Frames of twice the rate have fewer than twice the voxels.
    return this.#frames[known].ms * (known === rung ? 1 : (this.#bandwidths[rung] / this.#bandwidths[known]) ** 0.75);
  }
}
