/**
 * Decoded frames by number, bounded in bytes. What is farthest ahead of the playhead goes first, where frames just
 * behind it count as far ahead: a take that fits is kept whole and plays round without being decoded again.
 *
 * @template {{ bytes: number }} Frame
 */
export class Ring {
  bytes = 0;
  /** @type {Map<number, Frame>} */
  #frames = new Map();

  /** @param {number} budget bytes */
  constructor(budget) {
    this.budget = budget;
  }

  get size() {
    return this.#frames.size;
  }

  /** Mean bytes of a frame; 0 if there is none. */
  get meanBytes() {
    return this.#frames.size ? this.bytes / this.#frames.size : 0;
  }

  /** @param {number} number */
  get(number) {
    return this.#frames.get(number);
  }

  /** @param {number} number */
  has(number) {
    return this.#frames.has(number);
  }

  /** Numbers of the frames held, in no order. */
  numbers() {
    return this.#frames.keys();
  }

  /** @param {number} number @param {Frame} frame */
  put(number, frame) {
    this.drop(number);
    this.#frames.set(number, frame);
    this.bytes += frame.bytes;
  }

  clear() {
    this.#frames.clear();
    this.bytes = 0;
  }

  /**
   * Frees frames until the rest fits. The one that is least far is never freed.
   * @param {(number: number) => number} distance how far a frame is from being shown
   */
  trim(distance) {
    if (this.bytes <= this.budget) return;
    const byDistance = [...this.#frames.keys()].sort((a, b) => distance(b) - distance(a));
    byDistance.pop();
    for (const number of byDistance) {
      if (this.bytes <= this.budget) return;
      this.drop(number);
    }
  }

  /** Frees a frame. @param {number} number */
  drop(number) {
    const frame = this.#frames.get(number);
    if (!frame) return;
    this.bytes -= frame.bytes;
    this.#frames.delete(number);
  }
}
