import assert from 'node:assert/strict';
import { afterEach, test } from 'node:test';
import { LostPart } from '../src/failure.js';
import { Sound } from '../src/sound/sound.js';

/** What takes fragments, which are one second long: as browsers do, it opens what had ended. */
class FakeBuffer extends EventTarget {
  timestampOffset = 0;
  /** When the fragments that are there begin. @type {Set<number>} */
  held = new Set();
  /** Listeners that wait. */
  listening = 0;

  /** @param {FakeMedia} media */
  constructor(media) {
    super();
    this.media = media;
  }

  /** @param {string} type @param {any} then @param {any} options */
  addEventListener(type, then, options) {
    super.addEventListener(type, then, options);
    this.listening++;
    options.signal.addEventListener('abort', () => this.listening--);
  }

  /** @param {Uint8Array} bytes */
  appendBuffer([at]) {
    this.#change();
    if (at !== undefined) this.held.add(at);
  }

  /** @param {number} from @param {number} to */
  remove(from, to) {
    this.#change();
    for (const at of [...this.held]) if (at >= from && at < to) this.held.delete(at);
  }

  #change() {
    this.media.readyState = 'open';
    queueMicrotask(() => this.dispatchEvent(new Event('updateend')));
  }
}

/** @type {FakeMedia[]} */
const made = [];

class FakeMedia {
  static isTypeSupported = () => true;
  readyState = 'closed';
  onsourceopen = () => {};
  buffer = new FakeBuffer(this);

  constructor() {
    made.push(this);
    setImmediate(() => {
      this.readyState = 'open';
      this.onsourceopen();
    });
  }

  addSourceBuffer() {
    return this.buffer;
  }

  endOfStream() {
    this.readyState = 'ended';
  }
}

const element = {
  paused: true,
  currentTime: 0,
  seeking: false,
  readyState: 4,
  buffered: { length: 0 },
  play: async () => void (element.paused = false),
  pause: () => (element.paused = true),
  removeAttribute() {},
  load() {},
};
Object.assign(globalThis, {
  MediaSource: FakeMedia,
  document: { hidden: false, createElement: () => element, addEventListener() {}, removeEventListener() {} },
});
URL.createObjectURL = () => 'blob:';
URL.revokeObjectURL = () => {};

/** @type {Sound[]} */
const sounds = [];

afterEach(() => {
  for (const sound of sounds.splice(0)) sound.close();
});

const SECONDS = 60;

/** Lets what is under way come to rest. */
async function rest() {
  for (let turn = 0; turn < 20; turn++) await new Promise((next) => setImmediate(next));
}

/** Sound of a minute. @param {number[]} [lost] fragments that cannot be had */
async function begun(lost = []) {
  const track = {
    codec: 'opus',
    begin: 0,
    starts: Float64Array.from({ length: SECONDS }, (_, at) => at),
    init: async () => new Uint8Array(),
    fragment: async (/** @type {number} */ at) => {
      if (lost.includes(at)) throw new LostPart('missing', 'no such file');
      return Uint8Array.of(at);
    },
  };
  const on = { unsupported() {}, blocked() {}, volume() {}, gap() {}, stalled() {}, recovered() {} };
  const sound = /** @type {Sound} */ (Sound.of([track], { duration: SECONDS, on }));
  sounds.push(sound);
  await rest();
  return { sound, media: made[made.length - 1] };
}

/** Goes through the take once. @param {Sound} sound @param {number} jumps */
async function lap(sound, jumps) {
  for (let second = 0; second < SECONDS; second += 0.5) {
    element.currentTime = second;
    const clock = { seconds: second, jumps, speed: 1, loop: true, playing: true, held: false };
    sound.follow(/** @type {any} */ (clock), { still: false });
    await rest();
  }
}

for (const lost of [[], [SECONDS - 1]])
  test(`a media element knows the end of the sound each time round${lost.length ? ', though its last fragment is lost' : ''}`, async () => {
    const { sound, media } = await begun(lost);
    assert.equal(media.readyState, 'open');
    for (const round of [1, 2, 3]) {
      await lap(sound, round);
      assert.ok(media.buffer.held.has(SECONDS - 2));
      assert.equal(media.readyState, 'ended', `round ${round}`);
    }
    assert.equal(media.buffer.listening, 0, 'nothing listens any more');
  });
