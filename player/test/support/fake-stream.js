// Streams for tests of everything around the decoder: a packet is `[frame, keyframe]`, and decoding one after the wrong frame
// is noticed.

import { LostPart } from '../../src/failure.js';
import { Gops } from '../../src/gops.js';

/** Bytes of a decoded frame. */
export const FRAME_BYTES = 100;

/** What stands for a file that is open. @param {number} frames @param {number} gop @param {number} first the first keyframe */
export function fakeSource(frames, gop, first) {
  const gops = new Gops(Array.from({ length: frames }, (_, frame) => (frame >= first && frame % gop === 0 ? 1 : 0)));
  const source = {
    gops,
    frames,
    facts: [{ blockSide: 8 }],
    headers: [new Uint8Array(48)],
    /** The stream that packets come from now. */
    stream: 0,
    streamOf: () => source.stream,
    outdated: (/** @type {number} */ stream) => stream > source.stream,
    /** Set in what stands for a ladder. @type {object | null} */
    rungs: null,
    /** Keyframes of parts that cannot be had. @type {Set<number>} */
    gone: new Set(),
    /** Streams that are left for a frame that cannot be decoded. */
    others: 0,
    spoil: () => source.others-- > 0,
    offsetOf: (/** @type {number} */ frame) => 48 + 24 * frame,
    /** @type {number[]} */
    read: [],
    /** @type {Error | null} */
    fails: null,
    /** @param {number} frame */
    async packet(frame) {
      if (source.fails) throw source.fails;
      if (source.gone.has(gops.keyframeOf(frame))) throw new LostPart('missing', 'no such file');
      source.read.push(frame);
      return new Uint8Array(Float64Array.of(frame, gops.keyframeOf(frame) === frame ? 1 : 0).buffer);
    },
  };
  return source;
}

/** Stands for a worker: takes a turn of the event loop a packet. */
export class FakePort {
  /** @type {((event: { data: any }) => void) | null} */
  onmessage = null;
  onerror = null;
  terminated = false;
  /** Frames decoded, in order. @type {number[]} */
  decoded = [];
  /** Packets that cannot be decoded. @type {Set<number>} */
  damaged;
  /** @type {any[]} */
  #waiting = [];
  #last = -1;
  #lostRun = -1;

  /** @param {{ damaged?: Iterable<number>, refused?: Record<number, number>, memoryBytes?: number, bytesOf?: (frame: number) => number }} [options] */
  constructor({ damaged = [], refused = {}, memoryBytes = 0, bytesOf = () => FRAME_BYTES } = {}) {
    this.damaged = new Set(damaged);
    this.bytesOf = bytesOf;
    this.refused = refused;
    this.memoryBytes = memoryBytes;
  }

  /** @param {any} order */
  postMessage(order) {
    if (order.do === 'cancel') this.#waiting = [];
    if (order.do === 'decode' && this.#waiting.push(order) === 1) setImmediate(() => this.#next());
  }

  terminate() {
    this.terminated = true;
  }

  #next() {
    const order = this.#waiting.shift();
    if (order && order.run !== this.#lostRun) this.#decode(order);
    if (this.#waiting.length) setImmediate(() => this.#next());
  }

  /** @param {any} order */
  #decode({ run, frame, packet, surface, details, stream }) {
    const [number, keyframe] = new Float64Array(packet.buffer);
    this.decoded.push(number);
    if (this.damaged.has(number) || (!keyframe && this.#last !== number - 1)) {
      this.#lostRun = run;
      const message = this.damaged.has(number) ? 'damaged' : `frame ${number} after ${this.#last}`;
      return this.#answer({ is: 'lost', run, frame, message });
    }
    if (this.refused[number]) {
      this.#lostRun = run;
      return this.#answer({ is: 'lost', run, frame, message: 'too large', refused: true, blocks: this.refused[number] });
    }
    this.#last = number;
    const mesh = surface ? { number, stream, bytes: this.bytesOf(number), details: details ? {} : null } : null;
    this.#answer({ is: 'done', run, frame, mesh, memoryBytes: this.memoryBytes });
  }

  /** @param {any} data */
  #answer(data) {
    if (!this.terminated) this.onmessage?.({ data });
  }
}
