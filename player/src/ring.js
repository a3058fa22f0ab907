/**
 * Decoded frames by number, bounded in bytes. What is farthest ahead of the playhead goes first, where frames just
 * behind it count as far ahead: a take that fits is kept whole and plays round without being decoded again.
 *
 * Frames of a large scene share what stands still, in `batches`. Each batch counts once. Where one frame takes more than two thirds of
 * the bound, all may take half as much again as it does.
 *
 * @template {{ bytes: number, batches?: Set<{ bytes: number }> }} Frame
 */
export class Ring {
  bytes = 0;
  /** Most bytes that a frame has taken, with what it shares. */
  largest = 0;
  /** @type {Map<number, Frame>} */
  #frames = new Map();
  /** How many frames hold each batch. @type {Map<{ bytes: number }, number>} */
  #holders = new Map();
  /** Whether frames share anything. */
  #shares = false;

  /** @param {number} budget bytes */
  constructor(budget) {
    this.budget = budget;
  }

  get size() {
    return this.#frames.size;
  }

  /** Mean bytes that a frame adds to those that are there; 0 if there is none. */
  get meanBytes() {
    if (!this.size) return 0;
    if (!this.#shares || this.size === 1) return this.bytes / this.size;
    return Math.max(0, this.bytes - this.largest) / (this.size - 1);
  }

  /** Bytes that are left for frames beside one that shares all with them. */
  get room() {
    return this.#shares ? this.limit - this.largest : this.limit;
  }

  /** Bytes that all frames may take. */
  get limit() {
    return this.#shares ? Math.max(this.budget, 1.5 * this.largest) : this.budget;
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
    let all = 0;
    for (const batch of frame.batches ?? [frame]) {
      this.#hold(batch);
      all += batch.bytes;
    }
    this.largest = Math.max(this.largest, all);
    this.#shares ||= frame.batches !== undefined;
  }

  clear() {
    this.#frames.clear();
    this.#holders.clear();
    this.bytes = 0;
    this.largest = 0;
    this.#shares = false;
  }

  /**
   * Frees frames until the rest fits. The two that are least far are never freed, whatever they take: the playhead goes from
   * one to the other, and would wait for ever where only one of them was held.
   * @param {(number: number) => number} distance how far a frame is from being shown
   */
  trim(distance) {
    if (this.bytes <= this.limit) return;
    const byDistance = [...this.#frames.keys()].sort((a, b) => distance(b) - distance(a));
    byDistance.splice(-2);
    for (const number of byDistance) {
      if (this.bytes <= this.limit) return;
      this.drop(number);
    }
  }

  /** Frees a frame. @param {number} number */
  drop(number) {
    const frame = this.#frames.get(number);
    if (!frame) return;
    this.#frames.delete(number);
    for (const batch of frame.batches ?? [frame]) this.#release(batch);
  }

  /** @param {{ bytes: number }} batch */
  #hold(batch) {
    const holders = this.#holders.get(batch) ?? 0;
    this.#holders.set(batch, holders + 1);
    if (holders === 0) this.bytes += batch.bytes;
  }

  /** @param {{ bytes: number }} batch */
  #release(batch) {
    const holders = (this.#holders.get(batch) ?? 0) - 1;
    if (holders > 0) this.#holders.set(batch, holders);
    else this.#holders.delete(batch);
    if (holders === 0) this.bytes -= batch.bytes;
  }
}
