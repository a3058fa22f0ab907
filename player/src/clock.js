/**
 * Playback time: where in a take the playhead is. Knows nothing of decoding or drawing; one clock may drive several players.
 *
 * The position is counted in frames: 12.25 is a quarter of the way from frame 12 to frame 13. Players that share a clock
 * hold it back through {@link Clock.gates}: it never passes a frame that one of them cannot show yet.
 */
export class Clock {
  /** Position in frames, 0 to below `frames`. */
  position = 0;
  playing = false;
  loop = true;
  /** Since when, in ms, the clock waits for a frame; null if it does not. @type {number | null} */
  waitingSince = null;
  /**
   * Each gives the position, in frames, that the clock may not reach; asked with the position it is at.
   * @type {Set<(position: number) => number>}
   */
  gates = new Set();
  #frames;
  #fps;
  #speed = 1;
  /** Time of the last tick in ms. @type {number | null} */
  #last = null;

  /** @param {{ fps?: number, frames?: number }} [facts] frames a second, number of frames (Infinity while unknown) */
  constructor({ fps = 30, frames = 0 } = {}) {
    this.#fps = fps;
    this.#frames = frames;
  }

  get fps() {
    return this.#fps;
  }

  get frames() {
    return this.#frames;
  }

  /** Times real time, 1/16 to 16. */
  get speed() {
    return this.#speed;
  }

  set speed(speed) {
    if (!(speed > 0)) throw new RangeError(`a speed is above 0, not ${speed}`);
    this.#speed = Math.min(16, Math.max(1 / 16, speed));
  }

  /** The frame under the playhead. */
  get frame() {
    return Math.floor(this.position);
  }

  /** Seconds from the first frame. */
  get seconds() {
    return this.position / this.#fps;
  }

  /** What is played is known, or has changed. @param {{ fps: number, frames: number }} facts */
  set({ fps, frames }) {
    this.#fps = fps;
    this.#frames = frames;
    this.seek(this.frame);
  }

  /** Starts, from the beginning if the playhead is on the last frame and will not go round. */
  play() {
    if (this.playing) return;
    if (!this.loop && this.frame >= this.#frames - 1) this.position = 0;
    this.playing = true;
    this.#last = null;
  }

  pause() {
    this.playing = false;
    this.waitingSince = null;
    this.position = this.frame;
  }

  /** @param {number} frame taken to the nearest there is */
  seek(frame) {
    const last = Math.max(0, this.#frames - 1);
    this.position = Math.min(last, Math.max(0, Math.floor(Number.isFinite(frame) ? frame : 0)));
    this.waitingSince = null;
    this.#last = null;
  }

  /**
   * Moves on to a time. Asking twice for the same time changes nothing the second time.
   * @param {number} now ms, of any clock that goes forward
   * @returns {'wrapped' | 'ended' | null} what happened
   */
  tick(now) {
    const passed = this.#last === null ? 0 : Math.max(0, now - this.#last);
    this.#last = now;
    if (!this.playing || this.#frames === 0) return null;
    const wanted = this.position + (passed / 1000) * this.#fps * this.#speed;
    const gate = Math.min(Infinity, ...[...this.gates].map((gate) => gate(this.position)));
    if (wanted >= gate) {
      // Just before the frame that is not there, so that it is shown as soon as it is.
      this.position = Math.max(this.position, Math.min(wanted, gate - 1e-3));
      this.waitingSince ??= now;
      return null;
    }
    this.waitingSince = null;
    if (wanted < this.#frames) {
      this.position = wanted;
      return null;
    }
    if (this.loop) {
      this.position = (wanted - this.#frames) % this.#frames;
      return 'wrapped';
    }
    this.position = this.#frames - 1;
    this.playing = false;
    return 'ended';
  }
}
