// A worker's decoder without a worker: what `src/worker.js` does with packets, in turns of this thread.

import { Decoder } from '../../src/wasm.js';

export class DecoderPort {
  /** @type {((event: { data: any }) => void) | null} */
  onmessage = null;
  onerror = null;
  #decoder;
  #closed = false;
  /** @type {any[]} */
  #waiting = [];
  #lostRun = -1;

  /** @param {Decoder} decoder */
  constructor(decoder) {
    this.#decoder = decoder;
  }

  /** @param {any} order */
  postMessage(order) {
    if (order.do === 'start') this.#decoder.open(order.header);
    if (order.do === 'cancel') this.#waiting = [];
    if (order.do === 'decode' && this.#waiting.push(order) === 1) setImmediate(() => this.#next());
  }

  terminate() {
    this.#closed = true;
  }

  #next() {
    const order = this.#waiting.shift();
    if (order && !this.#closed && order.run !== this.#lostRun) this.onmessage?.({ data: this.#decoded(order) });
    if (this.#waiting.length) setImmediate(() => this.#next());
  }

  /** @param {any} order */
  #decoded({ run, frame, packet, at, surface, stream, header }) {
    try {
      if (header) this.#decoder.open(header);
      const { timestampNs } = this.#decoder.decode(packet, { at, surface, normals: true, details: false });
      return { is: 'done', run, frame, mesh: surface ? { stream, timestampNs, bytes: 100, decodeMs: 1, surfaceMs: 1 } : null };
    } catch (error) {
      this.#lostRun = run;
      return { is: 'lost', run, frame, message: /** @type {Error} */ (error).message };
    }
  }
}
