/**
 * Playback time: where in a take the playhead is, in seconds from its first frame. Knows nothing of decoding, drawing or sound;
 * one clock may drive several players.
 *
 * Players hold the clock back through {@link Clock.gates}: it never passes a frame that one of them cannot show yet. Sound, where
 * there is some, leads the clock.
 */

/**
 * What tells the time while it plays: sound.
 * @typedef {object} Leader
 * @property {(seconds: number, jumps: number) => number | null} time the time now, given that of the clock and how often it was moved; null
 *   where it does not lead
 * @property {boolean} stalled whether it has nothing to play yet
 */

/** Distance at which the clock stops before a missing frame, in seconds. */
const BEFORE = 1e-4;
/** Most ms that pass in one tick. Nobody calls in a hidden page: a take goes on where it was left. */
const MOST_PASSED = 1000;

export class Clock {
  /** Seconds from the first frame, 0 to below `duration`. */
  seconds = 0;
  playing = false;
  loop = true;
  /** Since when, in ms, the clock waits for a frame or for sound; null if it does not. @type {number | null} */
  waitingSince = null;
  /** Whether it waits for a frame: then sound waits, too. */
  held = false;
  /** Number of times it was moved other than by playing. */
  jumps = 0;
  /**
   * Each gives the time that the clock may not reach, asked with the time it is at. One that is not later holds it there.
   * @type {Set<(seconds: number) => number>}
   */
  gates = new Set();
  /** @type {Leader | null} */
  leader = null;
  /** Moves on from a time by seconds that have passed. A take whose frames are irregular gives another. */
  advance = plain;
  #duration;
  #last;
  #speed = 1;
  /** Time of the last tick in ms. @type {number | null} */
  #ticked = null;

  /** @param {{ duration?: number, last?: number }} [facts] seconds of the take, and when its last frame begins */
  constructor({ duration = 0, last = duration } = {}) {
    this.#duration = duration;
    this.#last = last;
  }

  /** Seconds; 0 until a take is open. */
  get duration() {
    return this.#duration;
  }

  /** Times real time, 1/16 to 16. */
  get speed() {
    return this.#speed;
  }

  set speed(speed) {
    if (!(speed > 0)) throw new RangeError(`a speed is above 0, not ${speed}`);
    this.#speed = Math.min(16, Math.max(1 / 16, speed));
  }

  /** What is played is known, or has changed. @param {{ duration: number, last: number }} facts */
  set({ duration, last }) {
    this.#duration = duration;
    this.#last = last;
    if (this.seconds > last) this.seek(last);
  }

  /** Another take is played: nothing is known of it. */
  reset() {
    this.set({ duration: 0, last: 0 });
    this.advance = plain;
    this.leader = null;
  }

  /** Starts, from the beginning if the playhead is on the last frame and will not go round. */
  play() {
    if (this.playing) return;
    if (!this.loop && this.#duration > 0 && this.seconds >= this.#last) this.#jump(0);
    this.playing = true;
    this.#ticked = null;
  }

  pause() {
    this.playing = false;
    this.waitingSince = null;
    this.held = false;
  }

  /** @param {number} seconds taken to the nearest frame there is */
  seek(seconds) {
    this.#jump(Math.min(this.#last, Math.max(0, Number.isFinite(seconds) ? seconds : 0)));
    this.waitingSince = null;
    this.held = false;
    this.#ticked = null;
  }

  /**
   * Moves on to a time. Asking twice for the same time changes nothing the second time.
   * @param {number} now ms, of any clock that goes forward
   * @returns {'wrapped' | 'ended' | null} what happened
   */
  tick(now) {
    const passed = this.#ticked === null ? 0 : Math.min(MOST_PASSED, Math.max(0, now - this.#ticked));
    this.#ticked = now;
    if (!this.playing || this.#duration === 0) return null;
    const led = this.leader?.time(this.seconds, this.jumps) ?? null;
    const wanted = led ?? this.advance(this.seconds, (passed / 1000) * this.#speed);
    // Sound has gone on, whatever is there to be seen.
    const from = led ?? this.seconds;
    const gate = Math.min(Infinity, ...[...this.gates].map((gate) => gate(Math.min(from, this.#last))));
    this.held = wanted >= gate;
    if (this.held || (led !== null && this.leader?.stalled)) this.waitingSince ??= now;
    else this.waitingSince = null;
    if (this.held) {
      // Just before the frame that is not there, so that it is shown as soon as it is.
      this.seconds = Math.max(Math.min(from, this.#last), Math.min(wanted, gate - BEFORE));
      return null;
    }
    if (wanted < this.#duration) {
      this.seconds = wanted;
      return null;
    }
    if (this.loop) {
      this.#jump(led === null ? (wanted - this.#duration) % this.#duration : 0);
      return 'wrapped';
    }
    this.#jump(this.#last);
    this.pause();
    return 'ended';
  }

  /** @param {number} seconds */
  #jump(seconds) {
    this.seconds = seconds;
    this.jumps++;
  }
}

/** @param {number} seconds @param {number} passed */
function plain(seconds, passed) {
  return seconds + passed;
}
