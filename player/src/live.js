// A live stream: its packets decoded in one worker as they come, shown after a jitter buffer of a few frames. What cannot be
// kept up with is dropped, up to the newest entry: a keyframe, or a resilient frame.

import { allowanceFor, allowanceOf, refusal } from './allowance.js';
import { IsvFailure, words } from './failure.js';
import { JitterBuffer } from './jitter-buffer.js';
import { Lane } from './lane.js';
import { LiveConnection } from './live-connection.js';
import { metadataOf } from './metadata.js';
import { Decoder } from './wasm.js';

/** Packets waiting above which those before the newest entry are dropped. */
const BEHIND = 12;
/** Packets waiting above which only the decoder is moved on and no surface is made. */
const HURRY = 3;
/** Bytes waiting above which all is dropped, to wait for the next entry. */
const MOST_BYTES = 1 << 26;
/** Timestamps above this are unix time in ns. */
const UNIX_NS = 1e18;

/**
 * @typedef {import('./worker.js').Frame} Frame
 * @typedef {{ packet: Uint8Array, serverMs: number, entry: boolean }} Waiting
 */

export class LiveSource {
  /** What the header says of the stream that runs now. @type {import('./wasm.js').StreamFacts | null} */
  facts = null;
  /** What it says of itself. @type {import('./metadata.js').Metadata} */
  metadata = {};
  playing = true;
  details = false;
  /** From capture, or from the server, to the picture shown last, in ms; null before it. @type {number | null} */
  latencyMs = null;
  /** Packets that were dropped to keep up. */
  dropped = 0;
  /** Is told of `state`, `open`, `described`, `lost` and, with an `error`, `error`. @type {(type: string, detail?: unknown) => void} */
  onevent = () => {};
  #module;
  #spawn;
  #allowance;
  #connection;
  /** @type {Lane | null} */
  #lane = null;
  /** @type {JitterBuffer<Frame & { serverMs: number }> | null} */
  #buffer = null;
  /** @type {Waiting[]} */
  #waiting = [];
  /** When the server had each packet that is with the worker, by number. @type {Map<number, number>} */
  #serverMs = new Map();
  #number = 0;
  #needsEntry = true;
  #feeding = false;
  /** How many streams have begun. */
  #streams = 0;
  #closed = false;
  /** Bits of late packets, for the rate. @type {{ at: number, bytes: number }[]} */
  #sizes = [];

  /**
   * @param {object} options
   * @param {string} options.url
   * @param {Promise<WebAssembly.Module>} options.module
   * @param {() => import('./lane.js').Port} options.spawn starts a worker
   * @param {import('./allowance.js').Allowance} [options.allowance] memory of the decoder
   * @param {(url: string) => import('./live-connection.js').Socket} [options.connect]
   */
  constructor({ url, module, spawn, allowance = allowanceOf(), connect = (url) => new WebSocket(url) }) {
    this.url = absolute(url);
    this.#module = module;
    this.#spawn = spawn;
    this.#allowance = allowance;
    this.#connection = new LiveConnection({
      connect: () => connect(this.url),
      on: {
        state: (state) => this.onevent('state', { state }),
        header: (header) => this.#begin(header),
        metadata: (packet) => {
          this.metadata = metadataOf(packet);
          this.onevent('described');
        },
        packet: (packet, serverMs, entry) => this.#take({ packet, serverMs, entry }),
      },
    });
    module.catch((error) => this.onevent('error', { error }));
  }

  get state() {
    return this.#connection.state;
  }

  /** Decoded frames that wait to be shown. */
  get buffered() {
    return this.#buffer?.length ?? 0;
  }

  /** Bits a second over the last seconds. */
  get bitrate() {
    const span = this.#sizes.length > 1 ? this.#sizes[this.#sizes.length - 1].at - this.#sizes[0].at : 0;
    return span > 0 ? (8000 * this.#sizes.slice(1).reduce((sum, { bytes }) => sum + bytes, 0)) / span : 0;
  }

  /** The frame to show now, if it is another than before. @param {number} now ms @returns {Frame | null} */
  next(now) {
    const frame = this.#buffer?.take(now) ?? null;
    if (!frame || !this.playing) return null;
    const captured = frame.timestampNs > UNIX_NS ? frame.timestampNs / 1e6 : frame.serverMs;
    this.latencyMs = this.#connection.serverNow - captured;
    return frame;
  }

  close() {
    this.#closed = true;
    this.#connection.close();
    this.#lane?.close();
    this.#waiting = [];
  }

  /** A stream begins, perhaps not the first: all that was is over. @param {Uint8Array} header */
  async #begin(header) {
    const stream = ++this.#streams;
    this.metadata = {};
    this.#drop();
    this.#lane?.close();
    this.#lane = null;
    this.#buffer = null;
    try {
      const module = await this.#module;
      const facts = (await Decoder.create(module)).open(header);
      if (stream !== this.#streams || this.#closed) return;
      const allowance = allowanceFor(this.#allowance, facts);
      this.facts = facts;
      this.#buffer = new JitterBuffer(facts.fps);
      this.#lane = new Lane(
        this.#spawn(),
        { module, header, allowance },
        {
          done: ({ frame, mesh }) => this.#done(frame, mesh),
          lost: (_, answer) => this.#lost(answer, facts.blockSide, allowance),
          broken: (error) => this.onevent('error', { error }),
        },
      );
      this.onevent('open');
      this.#feed();
    } catch (error) {
      const message = `the live stream cannot be played: ${words(error)}`;
      this.onevent('error', { error: new IsvFailure('unsupported', message, { cause: error }) });
    }
  }

  /** @param {Waiting} next */
  #take(next) {
    this.#measure(next.packet.length);
    if (this.#needsEntry && !next.entry) return;
    this.#needsEntry = false;
    this.#waiting.push(next);
    this.#keepUp();
    this.#feed();
  }

  /** Drops what is before the newest entry when too much waits. */
  #keepUp() {
    if (this.#waiting.reduce((bytes, { packet }) => bytes + packet.length, 0) > MOST_BYTES) {
      this.dropped += this.#waiting.length;
      return this.#drop();
    }
    if (this.#waiting.length <= BEHIND) return;
    const newest = this.#waiting.findLastIndex(({ entry }) => entry);
    if (newest <= 0) return;
    this.dropped += newest;
    this.#waiting.splice(0, newest);
  }

  #drop() {
    this.#waiting = [];
    this.#serverMs.clear();
    this.#needsEntry = true;
  }

  async #feed() {
    const lane = this.#lane;
    if (this.#feeding || !lane) return;
    this.#feeding = true;
    while (lane === this.#lane && this.#waiting.length) {
      await lane.room();
      const next = lane === this.#lane ? this.#waiting.shift() : undefined;
      if (!next) break;
      const frame = this.#number++;
      const surface = this.playing && this.#waiting.length <= HURRY;
      if (surface) this.#serverMs.set(frame, next.serverMs);
      lane.decode({ frame, packet: next.packet, at: 0, surface, details: this.details });
    }
    this.#feeding = false;
    if (lane !== this.#lane) this.#feed();
  }

  /** @param {number} number @param {Frame | null} mesh */
  #done(number, mesh) {
    const serverMs = this.#serverMs.get(number);
    this.#serverMs.delete(number);
    if (mesh && serverMs !== undefined) this.#buffer?.put({ ...mesh, serverMs }, performance.now());
  }

  /** A packet that is no good: the next entry is waited for. @param {import('./worker.js').Lost} answer @param {number} blockSide @param {import('./allowance.js').Allowance} allowance */
  #lost({ message, refused = false, blocks = 0 }, blockSide, allowance) {
    this.#lane?.cancel();
    const newest = this.#waiting.findIndex(({ entry }) => entry);
    if (newest < 0) this.#drop();
    else this.#waiting.splice(0, newest);
    const why = refused ? refusal(null, blocks, blockSide, allowance) : message;
    this.onevent('lost', { frame: this.#number, resumes: this.#number, message: why, refused, missing: false });
  }

  /** @param {number} bytes */
  #measure(bytes) {
    const at = performance.now();
    this.#sizes.push({ at, bytes });
    while (this.#sizes[0].at < at - 3000) this.#sizes.shift();
  }
}

/** A WebSocket's address from one that may be relative to the page. @param {string} url */
function absolute(url) {
  const whole = new URL(url, globalThis.location?.href);
  whole.protocol = whole.protocol.replace('http', 'ws');
  return whole.href;
}
