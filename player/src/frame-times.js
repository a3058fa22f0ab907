// When each frame of a take is shown.

import { upTo } from './sorted.js';

/** Seconds by which a time may be too early for its frame: browsers round the times of sound to microseconds. */
const ROUNDING = 1e-5;
/** Shortest and longest time between two frames that timestamps are believed in, in seconds: streams may be joined. */
const BELIEVED = [1e-3, 10];

export class FrameTimes {
  /** Start of each frame in seconds from the first, and one more: the end of the last. */
  starts;
  /** Timestamps of packets in nanoseconds, NaN where none has been read; null if `starts` are exact. @type {Float64Array | null} */
  #read = null;

  /** @param {Float64Array} starts ascending, one more than there are frames */
  constructor(starts) {
    this.starts = starts;
  }

  /** Times by the frame rate alone, until packets tell more. @param {number} frames @param {number} fps */
  static nominal(frames, fps) {
    const times = new FrameTimes(Float64Array.from({ length: frames + 1 }, (_, frame) => frame / fps));
    times.#read = new Float64Array(frames).fill(NaN);
    return times;
  }

  get frames() {
    return this.starts.length - 1;
  }

  /** Seconds from the first frame to the end of the last. */
  get duration() {
    return this.starts[this.frames];
  }

  /** Start of the last frame. */
  get last() {
    return this.starts[this.frames - 1];
  }

  /** The frame that is shown at a time; the nearest before the first and after the last. @param {number} seconds */
  frameAt(seconds) {
    return Math.min(this.frames - 1, Math.max(0, upTo(this.starts, seconds + ROUNDING)));
  }

  /** Takes the timestamp of a packet that has been read. @param {number} frame @param {number} timestampNs */
  learn(frame, timestampNs) {
    if (this.#read) this.#read[frame] = timestampNs;
  }

  /** Takes exact times of some frames, and where the last of them ends. @param {number} first @param {ArrayLike<number>} starts one more than frames */
  refine(first, starts) {
    for (let at = 0; at < starts.length; at++) this.starts[first + at] = starts[at];
  }

  /**
   * Moves on from a time. A frame stays for as long as timestamps say, where they are known, whatever `starts` gives it.
   * @param {number} from seconds
   * @param {number} passed seconds
   * @returns {number} seconds; beyond the duration where the end is passed
   */
  advance(from, passed) {
    if (!this.#read) return from + passed;
    let at = from;
    let left = passed;
    for (let frame = this.frameAt(at); frame < this.frames; frame++) {
      const pace = this.#lasts(frame) / (this.starts[frame + 1] - this.starts[frame]);
      const rest = (this.starts[frame + 1] - at) * pace;
      if (left < rest) return at + left / pace;
      left -= rest;
      at = this.starts[frame + 1];
    }
    return at + left;
  }

  /** Seconds that a frame stays. @param {number} frame */
  #lasts(frame) {
    const read = /** @type {Float64Array} */ (this.#read);
    const seconds = (read[frame + 1] - read[frame]) / 1e9;
    const known = seconds >= BELIEVED[0] && seconds <= BELIEVED[1];
    return known ? seconds : this.starts[frame + 1] - this.starts[frame];
  }
}
