/**
 * Decoded frames by number, bounded in bytes. What is farthest ahead of the playhead goes first, where frames just
 * behind it count as far ahead: a take that fits is kept whole and plays round without being decoded again.
 *
 * Frames of a large scene share what stands still, in `batches`. Each batch counts once. Where what frames share is more than the
 * bound has room for, they may take half as much again.
 *
 * @template {{ bytes: number, batches?: Set<{ bytes: number }> }} Frame
 */
export class Ring {
  bytes = 0;
  /** Those of them that several frames share. */
  sharedBytes = 0;
  /** @type {Map<number, Frame>} */
  #frames = new Map();
  /** How many frames hold each batch. @type {Map<{ bytes: number }, number>} */
  #holders = new Map();

  /** @param {number} budget bytes */
  constructor(budget) {
    this.budget = budget;
  }

  get size() {
    return this.#frames.size;
  }

  /** Mean bytes that a frame takes for itself; 0 if there is none. */
  get meanBytes() {
    return this.#frames.size ? (this.bytes - this.sharedBytes) / this.#frames.size : 0;
  }

  /** Bytes that all frames may take. */
  get limit() {
    return Math.max(this.budget, 1.5 * this.sharedBytes);
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
    for (const batch of frame.batches ?? [frame]) this.#hold(batch);
  }

  clear() {
    this.#frames.clear();
    this.#holders.clear();
    this.bytes = 0;
    this.sharedBytes = 0;
  }

  /**
   * Frees frames until the rest fits. The one that is least far is never freed.
   * @param {(number: number) => number} distance how far a frame is from being shown
   */
  trim(distance) {
    if (this.bytes <= this.limit) return;
    const byDistance = [...this.#frames.keys()].sort((a, b) => distance(b) - distance(a));
    byDistance.pop();
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
    if (holders === 1) this.sharedBytes += batch.bytes;
  }

  /** @param {{ bytes: number }} batch */
  #release(batch) {
    const holders = (this.#holders.get(batch) ?? 0) - 1;
    if (holders > 0) this.#holders.set(batch, holders);
    else this.#holders.delete(batch);
    if (holders === 0) this.bytes -= batch.bytes;
    if (holders === 1) this.sharedBytes -= batch.bytes;
  }
}
