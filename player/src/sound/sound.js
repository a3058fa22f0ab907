// Sound of a take: a media element that is given fragments, and that leads the clock while it plays.
//
// What is heard cannot be moved without being heard to be; what is seen can. So the clock goes where the sound is. Where a frame
// is missing, sound waits for it.

import { LostPart, isAbort, words } from '../failure.js';
import { payloadOf } from '../mp4/boxes.js';
import { upTo } from '../sorted.js';
import { MP3_TYPE, nameOfCodec, typesOf } from './tracks.js';

/** Seconds of sound fetched ahead of the playhead, and kept behind it. */
const AHEAD = 20;
const BEHIND = 20;
/** Seconds from the beginning that are there when a loop comes round. */
const AGAIN = 4;
/** Seconds by which the element may be off the clock when it starts: it is set right before it is heard. */
const OFF = 0.005;
/** Seconds before a fragment that cannot be had at which the clock goes by itself: elements stand still a little before their data ends. */
const BEFORE_GAP = 0.1;
/** Most seconds of a fragment: sound of which the last begins earlier than this before the take is not heard. */
const LONGEST_FRAGMENT = 60;
/** Waits in ms before a fetch that failed is tried again, the last one over and over. */
const RETRIES = [500, 1000, 2000, 4000, 8000];
/** Most fragments that are passed over one after the other: behind so many, the rest is not worth asking for. */
const MOST_LOST = 10;
/** What media elements call it that there is enough to go on. */
const HAVE_FUTURE_DATA = 3;

/**
 * What is told of sound.
 * @typedef {object} SoundEvents
 * @property {(detail: { message: string }) => void} unsupported sound cannot be played, and the take plays without
 * @property {() => void} blocked the browser plays no sound before the user has touched the page: it plays muted
 * @property {() => void} volume volume or muting has changed
 * @property {(detail: { begin: number, end: number, message: string }) => void} gap a fragment cannot be had, and the take plays on without it
 * @property {(error: Error) => void} stalled bytes cannot be read, which is tried again
 * @property {() => void} recovered they can
 */

/** @typedef {import('./tracks.js').SoundTrack} SoundTrack @typedef {import('../clock.js').Leader} Leader */

/** @implements {Leader} */
export class Sound {
  /** The element that is heard: one for video, as browsers let only these begin muted. @type {HTMLVideoElement} */
  element;
  #track;
  /** What the browser takes it as. */
  #type;
  #on;
  #duration;
  /** When fragments begin, in seconds. */
  #starts;
  /** @type {SourceBuffer | null} */
  #buffer = null;
  #media;
  /** Fragments that were given to the element. @type {Set<number>} */
  #given = new Set();
  /** Fragments that cannot be had. @type {Set<number>} */
  #lost = new Set();
  /** How many of them follow each other. */
  #lostInARow = 0;
  #closing = new AbortController();
  /** The fragment that is on its way. @type {{ at: number, abort: AbortController } | null} */
  #fetching = null;
  #feeding = false;
  #failures = 0;
  #failed = false;
  /** Place of the playhead, and number of its jumps, when {@link Sound.follow} was last called. */
  #seconds = 0;
  #jumps = -1;
  #loops = true;
  /** Whether there was sound at the playhead then. */
  #covered = false;
  /** Whether the element went on at the last call. */
  #going = false;
  #starting = false;
  /** Whether the browser lets it begin not even muted: then the clock goes by itself until the user wants sound. */
  #locked = false;
  #hide = () => this.#visibility();

  /**
   * The sound of a take, or nothing where the browser plays none of its tracks.
   * @param {import('./tracks.js').SoundTracks} tracks
   * @param {{ duration: number, on: SoundEvents, volume?: number, muted?: boolean }} options duration of the take in seconds
   * @returns {Sound | null}
   */
  static of(tracks, { duration, on, volume = 1, muted = false }) {
    const { MediaSource: Plain, ManagedMediaSource: Managed } = /** @type {any} */ (globalThis);
    /** @type {typeof MediaSource | undefined} */
    const Media = Plain ?? Managed;
    const ways = tracks.flatMap((track) => typesOf(track.codec).map((type) => ({ track, type })));
    const way = Media && ways.find(({ type }) => Media.isTypeSupported(type));
    // A take that is stamped with the time of day may lie where its sound does not.
    const elsewhere = tracks.every(({ starts }) => starts[starts.length - 1] < -LONGEST_FRAGMENT);
    if (elsewhere) {
      on.unsupported({ message: 'the take plays without sound: that ends before its first frame' });
      return null;
    }
    if (!Media || !way) {
      const names = [...new Set(tracks.map(({ codec }) => nameOfCodec(codec)))].join(', ');
      const why = Media ? `this browser does not play ${names} from MP4` : 'this browser lets no page give it sound piece by piece';
      on.unsupported({ message: `the take plays without sound: ${why}` });
      return null;
    }
    return new Sound(way, new Media(), { duration, on, volume, muted });
  }

  /** @param {{ track: SoundTrack, type: string }} way @param {MediaSource} media @param {{ duration: number, on: SoundEvents, volume: number, muted: boolean }} options */
  constructor({ track, type }, media, { duration, on, volume, muted }) {
    this.#track = track;
    this.#type = type;
    this.#media = media;
    this.#on = on;
    this.#duration = duration;
    // What begins after the take is not played.
    const { starts } = track;
    this.#starts = starts.filter((start, at) => at === 0 || start < duration);
    this.element = document.createElement('video');
    this.element.playsInline = true;
    this.element.preload = 'auto';
    this.element.disableRemotePlayback = true;
    this.element.volume = volume;
    this.element.muted = muted;
    this.element.onvolumechange = () => on.volume();
    this.element.ontimeupdate = () => this.#feed();
    this.element.onwaiting = () => this.#recheck();
    this.element.onerror = () => this.#fail(this.element.error?.message || 'the browser cannot decode it');
    media.onsourceopen = () => this.#begin();
    this.element.src = URL.createObjectURL(media);
    document.addEventListener('visibilitychange', this.#hide);
  }

  /** What the browser calls the codec. */
  get codec() {
    return this.#track.codec;
  }

  /** Whether the element has nothing to play yet. */
  get stalled() {
    return this.#going && (this.element.seeking || this.element.readyState < HAVE_FUTURE_DATA);
  }

  get volume() {
    return this.element.volume;
  }

  set volume(volume) {
    this.element.volume = Math.min(1, Math.max(0, volume));
  }

  get muted() {
    return this.element.muted;
  }

  set muted(muted) {
    this.element.muted = muted;
    if (muted || !this.#locked) return;
    this.#locked = false;
    // Now, as this may be the user's click.
    this.#start();
  }

  /** @param {number} seconds of the clock @param {number} jumps @returns {number | null} */
  time(seconds, jumps) {
    if (!this.#covers(seconds)) return null;
    // The element is not there yet: the clock stands.
    if (jumps !== this.#jumps || !this.#covered || this.element.seeking) return seconds;
    const { currentTime } = this.element;
    return this.#covers(currentTime) ? currentTime : Math.max(seconds, currentTime);
  }

  /**
   * Does as the clock does: called after each of its ticks.
   * @param {import('../clock.js').Clock} clock
   * @param {{ still: boolean }} how whether the playhead is being dragged
   */
  follow(clock, { still }) {
    if (this.#failed) return;
    const { seconds, jumps, speed } = clock;
    const { element } = this;
    if (element.playbackRate !== speed) {
      element.playbackRate = speed;
      // Sound that is stretched is heard tens of milliseconds before the time that the element tells; slower sound is lower instead.
      element.preservesPitch = speed >= 1;
    }
    const moved = jumps !== this.#jumps && !still;
    this.#loops = clock.loop;
    this.#seconds = seconds;
    const covered = this.#covers(seconds);
    // The clock went by itself while there was no sound.
    const late = covered && !this.#covered && Math.abs(element.currentTime - seconds) > OFF;
    if (covered && (moved || late) && element.currentTime !== seconds) element.currentTime = seconds;
    if (moved) this.#jumps = jumps;
    this.#covered = covered;
    const going = covered && clock.playing && !clock.held && !still && !document.hidden;
    this.#going = going;
    if (going && element.paused) this.#start();
    if (!going && !element.paused) element.pause();
    this.#feed();
  }

  close() {
    this.#failed = true;
    this.#going = false;
    this.#closing.abort();
    document.removeEventListener('visibilitychange', this.#hide);
    const { element } = this;
    element.onerror = element.ontimeupdate = element.onwaiting = element.onvolumechange = null;
    element.pause();
    URL.revokeObjectURL(element.src);
    element.removeAttribute('src');
    element.load();
  }

  /** Nobody sees a hidden page, and nobody calls `follow` in it: the take stands still. */
  #visibility() {
    if (!document.hidden) return;
    this.#going = false;
    this.element.pause();
  }

  async #start() {
    if (this.#starting) return;
    this.#starting = true;
    try {
      await this.element.play();
    } catch (error) {
      const refused = error instanceof Error && error.name === 'NotAllowedError';
      if (refused && !this.element.muted) {
        this.element.muted = true;
        this.#on.blocked();
      } else if (refused) this.#locked = true;
    } finally {
      this.#starting = false;
    }
  }

  async #begin() {
    this.#media.onsourceopen = null;
    try {
      this.#media.duration = Math.max(this.#duration, this.#starts[this.#starts.length - 1]);
      const buffer = this.#media.addSourceBuffer(this.#type);
      buffer.timestampOffset = -this.#track.begin;
      const init = await this.#retried(() => this.#track.init());
      if (this.#failed) return;
      if (this.#type !== MP3_TYPE) await appended(buffer, init);
      this.#buffer = buffer;
      this.#feed();
    } catch (error) {
      this.#fail(words(error));
    }
  }

  /** Whether there is sound at a time, as far as that is known. @param {number} seconds */
  #covers(seconds) {
    if (this.#failed || this.#locked || seconds >= this.#duration) return false;
    if (this.element.ended && seconds >= this.element.currentTime - OFF) return false;
    const starts = this.#starts;
    if (seconds < starts[0] - OFF) return false;
    const at = indexOf(starts, seconds);
    const settled = (/** @type {number} */ one) => one >= starts.length || this.#given.has(one) || this.#lost.has(one);
    const beside = this.#lost.has(at) || (this.#given.has(at) && this.#lost.has(at - 1));
    if (!beside && !(settled(at) && settled(at + 1))) return true;
    // All that there is around it has been given: what is missing now does not exist.
    const { buffered } = this.element;
    const margin = this.#lost.has(at) || this.#lost.has(at + 1) ? BEFORE_GAP : OFF;
    for (let range = 0; range < buffered.length; range++)
      if (buffered.start(range) <= seconds && seconds < buffered.end(range) - margin) return true;
    return false;
  }

  /** A browser that is short of memory may have dropped what it was given: it is given again. */
  #recheck() {
    const { buffered, currentTime } = this.element;
    for (let range = 0; range < buffered.length; range++)
      if (buffered.start(range) <= currentTime && currentTime < buffered.end(range) - OFF) return;
    this.#given.delete(indexOf(this.#starts, currentTime));
    this.#feed();
  }

  async #feed() {
    const buffer = this.#buffer;
    if (!buffer || this.#feeding || this.#failed) {
      // What is on its way may not be wanted any more.
      if (this.#fetching && !this.#wanted().includes(this.#fetching.at)) this.#fetching.abort.abort();
      return;
    }
    this.#feeding = true;
    try {
      for (let at = this.#wanted()[0]; at !== undefined && !this.#failed; at = this.#wanted()[0]) {
        const abort = new AbortController();
        this.#fetching = { at, abort };
        const signal = AbortSignal.any([abort.signal, this.#closing.signal]);
        try {
          const fragment = await this.#retried(() => this.#track.fragment(at, signal));
          this.#fetching = null;
          await this.#give(buffer, at, fragment);
          this.#lostInARow = 0;
        } catch (error) {
          if (error instanceof LostPart) this.#lose(at, error);
          else if (!isAbort(error)) throw error;
        }
      }
    } catch (error) {
      this.#fail(words(error));
    } finally {
      this.#fetching = null;
      this.#feeding = false;
    }
  }

  /** Passes over a fragment, and gives up behind too many. @param {number} at @param {LostPart} why */
  #lose(at, why) {
    if (++this.#lostInARow >= MOST_LOST) throw why;
    this.#lost.add(at);
    const begin = this.#starts[at];
    this.#on.gap({ begin: Math.max(0, begin), end: Math.min(this.#duration, this.#starts[at + 1] ?? this.#duration), message: words(why) });
    this.#end();
  }

  /** Fragments that are wanted and not there, the first one first. @returns {number[]} */
  #wanted() {
    const starts = this.#starts;
    /** @type {number[]} */
    const wanted = [];
    const want = (/** @type {number} */ from, /** @type {number} */ to) => {
      for (let at = indexOf(starts, from); at < starts.length && starts[at] < to; at++)
        if (!this.#given.has(at) && !this.#lost.has(at)) wanted.push(at);
    };
    const end = Math.min(this.#duration, this.#seconds + AHEAD);
    want(this.#seconds, end);
    if (this.#loops && this.#seconds + AHEAD > this.#duration) want(0, AGAIN);
    return wanted;
  }

  /** @param {SourceBuffer} buffer @param {number} at @param {Uint8Array} fragment */
  async #give(buffer, at, fragment) {
    await this.#trim(buffer, BEHIND);
    let bytes = fragment;
    if (this.#type === MP3_TYPE) {
      bytes = payloadOf(fragment);
      // MP3 says nothing of its times.
      buffer.timestampOffset = this.#starts[at];
    }
    try {
      await appended(buffer, bytes);
    } catch (error) {
      if (!(error instanceof Error && error.name === 'QuotaExceededError')) throw error;
      await this.#trim(buffer, 1);
      await appended(buffer, bytes);
    }
    this.#given.add(at);
    this.#end();
  }

  /** Says that nothing comes behind the last fragment, if that is so. Each fragment that is given later takes that back. */
  #end() {
    const last = this.#starts.length - 1;
    if (!this.#given.has(last) && !this.#lost.has(last)) return;
    if (this.#media.readyState === 'open') this.#media.endOfStream();
  }

  /** Frees what is long past. @param {SourceBuffer} buffer @param {number} behind seconds */
  async #trim(buffer, behind) {
    const starts = this.#starts;
    const from = this.#loops ? AGAIN : 0;
    const first = indexOf(starts, from) + (from > starts[0] ? 1 : 0);
    const last = indexOf(starts, this.#seconds - behind);
    const gone = [...this.#given].filter((at) => at >= first && at < last);
    if (!gone.length) return;
    const begin = Math.max(0, starts[Math.min(...gone)]);
    const end = starts[Math.max(...gone) + 1];
    if (end <= begin) return;
    buffer.remove(begin, end);
    await settled(buffer);
    for (const at of gone) this.#given.delete(at);
  }

  /**
   * Makes a request again until it succeeds, or is not wanted any more.
   * @template T
   * @param {() => Promise<T>} request
   * @returns {Promise<T>}
   */
  async #retried(request) {
    for (;;) {
      try {
        const answer = await request();
        this.#readAgain();
        return answer;
      } catch (error) {
        if (error instanceof LostPart) {
          this.#readAgain();
          throw error;
        }
        const { kind } = /** @type {{ kind?: string }} */ (error);
        if (kind !== 'missing' || this.#failed) throw error;
        this.#on.stalled(/** @type {Error} */ (error));
        const wait = RETRIES[Math.min(this.#failures++, RETRIES.length - 1)];
        await new Promise((wake) => setTimeout(wake, wait));
      }
    }
  }

  /** A server has answered. */
  #readAgain() {
    if (this.#failures) this.#on.recovered();
    this.#failures = 0;
  }

  /** The take goes on without sound. @param {string} why */
  #fail(why) {
    if (this.#failed) return;
    this.close();
    this.#on.unsupported({ message: `the take plays without sound: ${why}` });
  }
}

/** The last entry that is not above a value; the first if all are. @param {Float64Array} sorted @param {number} value */
function indexOf(sorted, value) {
  return Math.max(0, upTo(sorted, value));
}

/** @param {SourceBuffer} buffer @param {Uint8Array} bytes */
async function appended(buffer, bytes) {
  buffer.appendBuffer(/** @type {Uint8Array<ArrayBuffer>} */ (bytes));
  await settled(buffer);
}

/** @param {SourceBuffer} buffer */
function settled(buffer) {
  return new Promise((/** @type {(value: void) => void} */ resolve, reject) => {
    const listening = new AbortController();
    const { signal } = listening;
    const on = (/** @type {string} */ type, /** @type {() => void} */ then) => buffer.addEventListener(type, then, { signal });
    // A buffer is waited for again and again: what is over leaves no listener behind.
    on('updateend', () => (listening.abort(), resolve()));
    on('error', () => (listening.abort(), reject(new Error('the browser cannot read it'))));
  });
}
