// A decoder in a worker, as the side that deals work to it sees it.

import { IsvFailure } from './failure.js';
import { PartedSurface } from './parts.js';

/** Surfaces asked of a worker before it has answered: enough that it never waits for this thread, few enough to fit beside the ring. */
const SURFACES = 6;
/** Packets given to it before it has answered: a GOP can be gone through, on the way to a frame, without this thread. */
const PACKETS = 48;

/**
 * What a lane needs of a Web Worker; a test gives something else.
 * @typedef {object} Port
 * @property {(order: import('./worker.js').Order, transfer?: Transferable[]) => void} postMessage
 * @property {((event: { data: import('./worker.js').Answer }) => void) | null} onmessage
 * @property {((event: { message?: string }) => void) | null} onerror
 * @property {() => void} terminate
 */

/** What is being decoded by a lane: some frames of a run, in order. */
export class Task {
  cancelling = new AbortController();

  /** @param {number} id @param {number} at the next frame to give to the worker @param {number} end the frame before which to stop */
  constructor(id, at, end) {
    this.id = id;
    this.at = at;
    this.end = end;
  }

  get cancelled() {
    return this.cancelling.signal.aborted;
  }
}

export class Lane {
  /** @type {Task | null} */
  task = null;
  /** The frame that the decoder would go on with; -1 if it needs a keyframe. */
  next = -1;
  /** The stream of the last packet; -1 if that does not matter. */
  stream = 0;
  /** Frames on their way that will come with a surface. @type {Set<number>} */
  coming = new Set();
  #port;
  #surface = new PartedSurface();
  /** Packets not answered yet. */
  #waiting = 0;
  /** Who waits for room. @type {(() => void)[]} */
  #wakes = [];
  #generation = 0;

  /**
   * @param {Port} port
   * @param {{ module: WebAssembly.Module, header: Uint8Array, allowance?: import('./allowance.js').Allowance }} start
   * @param {{ ready?(): void, done(answer: import('./worker.js').Done): void, lost(lane: Lane, answer: import('./worker.js').Lost): void, broken(error: Error): void }} on
   */
  constructor(port, start, on) {
    this.#port = port;
    port.onmessage = ({ data }) => this.#answer(data, on);
    port.onerror = ({ message }) =>
      on.broken(new IsvFailure('unsupported', `the decoder cannot be started: ${message ?? 'its script does not load'}`));
    port.postMessage({ do: 'start', ...start });
  }

  /** Waits until the worker can take another packet. @returns {Promise<void> | undefined} nothing to wait for if it can now */
  room() {
    if (this.coming.size < SURFACES && this.#waiting < PACKETS) return undefined;
    return new Promise((wake) => this.#wakes.push(wake));
  }

  /**
   * @param {{ frame: number, packet: Uint8Array, at: number, surface: boolean, details: boolean, stream?: number, header?: Uint8Array }} work `header`
   *   opens the decoder anew where the packet is of another stream than the one before
   */
  decode({ frame, packet, at, surface, details, stream = 0, header }) {
    this.#waiting++;
    if (surface) this.coming.add(frame);
    this.next = frame + 1;
    const anew = stream === this.stream ? undefined : header;
    this.stream = stream;
    const order = /** @type {const} */ ({ do: 'decode', run: this.#generation, frame, packet, at, surface, details, stream, header: anew });
    this.#port.postMessage(order, [/** @type {ArrayBuffer} */ (packet.buffer)]);
  }

  /** Gives up what is being done and what waits. The decoder then needs a keyframe. */
  cancel() {
    this.task?.cancelling.abort();
    this.task = null;
    this.next = -1;
    this.coming.clear();
    this.#generation++;
    // What would have opened the decoder anew may be among what is given up.
    this.stream = -1;
    this.#waiting = 0;
    this.#rouse();
    this.#port.postMessage({ do: 'cancel' });
  }

  close() {
    this.task?.cancelling.abort();
    this.task = null;
    this.#rouse();
    this.#port.terminate();
  }

  #rouse() {
    for (const wake of this.#wakes.splice(0)) wake();
  }

  /** @param {import('./worker.js').Answer} answer @param {ConstructorParameters<typeof Lane>[2]} on */
  #answer(answer, on) {
    if (answer.is === 'ready') return on.ready?.();
    if (answer.is === 'broken')
      return on.broken(new IsvFailure('unsupported', `the decoder cannot be started: ${answer.message}`));
    const current = answer.run === this.#generation;
    // What is given up has moved the decoder on, too.
    if (answer.is === 'done' && answer.mesh) answer.mesh = this.#surface.complete(answer.mesh);
    if (current) {
      this.#waiting--;
      this.coming.delete(answer.frame);
      this.#rouse();
    }
    if (answer.is === 'done') on.done(answer);
    else if (current) on.lost(this, answer);
  }
}
