/** Reading parts of a file: by HTTP ranges, or of a file on this device. Small reads are merged into large ones. */

import { IsvFailure, isAbort, words } from './failure.js';
import { SILENCE, Silence } from './silence.js';

/** The unit in which bytes are fetched and kept. */
const CHUNK = 1 << 18;
/** How much is read ahead of what was asked for. */
const AHEAD = 1 << 21;
/** Bytes kept. Compressed frames are small: this is tens of seconds around the playhead. */
const KEPT = 1 << 25;
/** Bytes taken from each end of a file when it is opened: header and first frames, index and trailer. */
const HEAD = CHUNK;
const TAIL = 1 << 16;

/**
 * Where the bytes come from.
 * @typedef {object} Bytes
 * @property {string} name
 * @property {() => Promise<number>} open reads both ends; gives the length of the file in bytes
 * @property {(from: number, to: number, signal?: AbortSignal) => Promise<Uint8Array>} read bytes `from` to before `to`
 * @property {(from: number, to: number, signal?: AbortSignal) => Promise<Uint8Array>} readAlone the same, but never more than these
 * @property {() => void} close
 */

/** A file on this device. @implements {Bytes} */
export class BlobBytes {
  #blob;

  /** @param {Blob} blob @param {string} [name] */
  constructor(blob, name = /** @type {File} */ (blob).name ?? 'stream') {
    this.#blob = blob;
    this.name = name;
  }

  async open() {
    return this.#blob.size;
  }

  /** @param {number} from @param {number} to */
  async read(from, to) {
    try {
      return new Uint8Array(await this.#blob.slice(from, to).arrayBuffer());
    } catch (cause) {
      throw new IsvFailure('missing', `${this.name} cannot be read any more: was it moved or changed?`, { cause });
    }
  }

  /** @param {number} from @param {number} to */
  readAlone(from, to) {
    return this.read(from, to);
  }

  close() {}
}

/**
 * A file on a server. Chunks are kept for a while; neighbouring ones that are missing are fetched by one request, with
 * some more ahead. A server that ignores ranges sends the whole file, which is then kept, up to a limit.
 * @implements {Bytes}
 */
export class HttpBytes {
  /** @type {Map<number, Promise<Uint8Array>>} chunks by number, in order of last use */
  #chunks = new Map();
  /** @type {Uint8Array | null} the whole file, from a server without ranges */
  #whole = null;
  /** The end of the file, as it was read when it was opened. @type {{ from: number, bytes: Uint8Array } | null} */
  #tail = null;
  #length = 0;
  /** @type {string | null} what tells this version of the file from another */
  #version = null;
  #closing = new AbortController();
  /** Silence of the server before and in each answer whose body is read. @type {WeakMap<Response, Silence>} */
  #silences = new WeakMap();
  /** Requests made so far. */
  requests = 0;

  /** @param {string} url @param {{ limit?: number, silence?: number, fetch?: typeof fetch }} [options] most bytes of a file read whole, and ms without a byte */
  constructor(url, { limit = 1 << 29, silence = SILENCE, fetch: get = (input, init) => fetch(input, init) } = {}) {
    this.url = url;
    this.name = nameOf(url);
    this.limit = limit;
    this.silence = silence;
    this.fetch = get;
  }

  async open() {
    const tailing = new AbortController();
    const tail = this.#request(`bytes=-${TAIL}`, AbortSignal.any([tailing.signal, this.#closing.signal]));
    tail.catch(() => {}); // Looked at below, unless the head already failed.
    const head = await this.#request(`bytes=0-${HEAD - 1}`, this.#closing.signal);
    if (head.status === 200) {
      tailing.abort();
      this.#whole = await this.#body(head, this.limit);
      this.#length = this.#whole.length;
      return this.#length;
    }
    const { total } = this.#contentRange(head);
    this.#length = total;
    this.#version = head.headers.get('etag');
    this.#keepHead(await this.#body(head, HEAD));
    await this.#keepTail(await tail.catch(() => null));
    return total;
  }

  /** @param {number} from @param {number} to @param {AbortSignal} [signal] @returns {Promise<Uint8Array>} */
  async read(from, to, signal) {
    if (this.#whole) return this.#whole.subarray(from, to);
    if (this.#tail && from >= this.#tail.from) return this.#tail.bytes.subarray(from - this.#tail.from, to - this.#tail.from);
    const first = Math.floor(from / CHUNK);
    const last = Math.floor((to - 1) / CHUNK);
    for (let chunk = first; chunk <= last; chunk++) if (!this.#chunks.has(chunk)) this.#load(chunk, last);
    // A read may be larger than what is kept.
    const loading = Array.from({ length: last + 1 - first }, (_, at) => this.#chunks.get(first + at));
    this.#trim();
    const bytes = new Uint8Array(to - from);
    for (let chunk = first; chunk <= last; chunk++) {
      const held = /** @type {Uint8Array} */ (await loading[chunk - first]);
      signal?.throwIfAborted();
      const start = Math.max(from, chunk * CHUNK);
      const end = Math.min(to, (chunk + 1) * CHUNK);
      bytes.set(held.subarray(start - chunk * CHUNK, end - chunk * CHUNK), start - from);
      this.#touch(chunk);
    }
    this.#readAhead(last + 1);
    return bytes;
  }

  /** Reads bytes that lie among others that are not wanted now. @param {number} from @param {number} to @param {AbortSignal} [signal] @returns {Promise<Uint8Array>} */
  async readAlone(from, to, signal) {
    const last = Math.floor((to - 1) / CHUNK);
    let held = Boolean(this.#whole || (this.#tail && from >= this.#tail.from));
    if (!held) {
      let chunk = Math.floor(from / CHUNK);
      while (chunk <= last && this.#chunks.has(chunk)) chunk++;
      held = chunk > last;
    }
    if (held) return this.read(from, to, signal);
    const signals = [this.#closing.signal, ...(signal ? [signal] : [])];
    return this.#part(await this.#request(`bytes=${from}-${to - 1}`, AbortSignal.any(signals)), from, to);
  }

  close() {
    this.#closing.abort();
    this.#chunks.clear();
    this.#whole = null;
  }

  /** Asks for missing chunks from `first` on: up to `last`, and ahead up to one that is there. @param {number} first @param {number} last */
  #load(first, last) {
    const end = Math.min(Math.ceil(this.#length / CHUNK), Math.max(last + 1, first + AHEAD / CHUNK));
    let next = first;
    while (next < end && !this.#chunks.has(next)) next++;
    const from = first * CHUNK;
    const to = Math.min(this.#length, next * CHUNK);
    const loading = this.#request(`bytes=${from}-${to - 1}`, this.#closing.signal).then((r) => this.#part(r, from, to));
    for (let chunk = first; chunk < next; chunk++) {
      const at = (chunk - first) * CHUNK;
      const held = loading.then((bytes) => bytes.slice(at, at + CHUNK));
      // What failed is asked for again by the next read.
      held.catch(() => this.#chunks.delete(chunk));
      this.#chunks.set(chunk, held);
    }
  }

  /** Half of what is read ahead is asked for before the other half is used up. @param {number} chunk */
  #readAhead(chunk) {
    for (let ahead = chunk; ahead < chunk + AHEAD / CHUNK / 2; ahead++) {
      if (ahead * CHUNK >= this.#length) return;
      if (!this.#chunks.has(ahead)) {
        this.#load(ahead, ahead);
        return this.#trim();
      }
    }
  }

  #trim() {
    for (const chunk of this.#chunks.keys()) {
      if (this.#chunks.size * CHUNK <= KEPT) return;
      this.#chunks.delete(chunk);
    }
  }

  /** @param {number} chunk */
  #touch(chunk) {
    const held = this.#chunks.get(chunk);
    if (!held) return;
    this.#chunks.delete(chunk);
    this.#chunks.set(chunk, held);
  }

  /** @param {Uint8Array} bytes */
  #keepHead(bytes) {
    const whole = bytes.length === CHUNK || bytes.length === this.#length;
    if (whole) this.#chunks.set(0, Promise.resolve(bytes));
  }

  /** @param {Response | null} response none if the request failed: then the end is read when it is asked for */
  async #keepTail(response) {
    if (response?.status !== 206) return;
    const { from } = this.#contentRange(response);
    this.#tail = { from, bytes: await this.#body(response, TAIL) };
  }

  /** @param {string} range @param {AbortSignal} signal */
  async #request(range, signal) {
    this.requests++;
    const silence = new Silence(this.silence);
    let response;
    try {
      response = await this.fetch(this.url, { headers: { range }, signal: AbortSignal.any([signal, silence.signal]) });
      this.#silences.set(response, silence);
    } catch (cause) {
      if (silence.isTooLong) throw this.#unanswered(cause);
      if (isAbort(cause)) throw cause;
      throw new IsvFailure('missing', `${this.name} cannot be fetched: ${words(cause)}`, { cause });
    } finally {
      silence.end();
    }
    if (response.ok) return response;
    if (response.status === 416) throw new IsvFailure('not-isv', `${this.name} is empty`);
    const why =
      response.status === 404 ? 'the server has no such file' : `the server says ${response.status} ${response.statusText}`;
    throw new IsvFailure('missing', `${this.name}: ${why}`.trim());
  }

  /** What a request fails with of which nothing comes any more: it is made again. @param {unknown} cause */
  #unanswered(cause) {
    return new IsvFailure('missing', `${this.name}: the server sends nothing`, { cause });
  }

  /** The bytes of a part that was asked for. @param {Response} response @param {number} from @param {number} to */
  async #part(response, from, to) {
    if (response.status !== 206) throw new IsvFailure('unsupported', `${this.name}: the server no longer sends parts`);
    const part = this.#contentRange(response);
    const version = response.headers.get('etag');
    if (part.total !== this.#length || version !== this.#version)
      throw new IsvFailure('damaged', `${this.name} has changed on the server: load it again`);
    const bytes = await this.#body(response, to - from);
    if (part.from !== from || bytes.length !== to - from)
      throw new IsvFailure('damaged', `${this.name}: the server sent another part than was asked for`);
    return bytes;
  }

  /** @param {Response} response */
  #contentRange(response) {
    const match = /^bytes (\d+)-(\d+)\/(\d+)$/.exec(response.headers.get('content-range') ?? '');
    if (!match) throw new IsvFailure('unsupported', `${this.name}: the server sends parts without saying which`);
    return { from: Number(match[1]), total: Number(match[3]) };
  }

  /** A body, refused as soon as it is longer than a limit. @param {Response} response @param {number} limit */
  async #body(response, limit) {
    const announced = Number(response.headers.get('content-length') ?? 0);
    const refuse = () => new IsvFailure('limit', `${this.name} has more than ${limit} bytes and the server sends it only whole`);
    if (announced > limit) {
      await response.body?.cancel();
      throw refuse();
    }
    const silence = this.#silences.get(response);
    silence?.begin();
    try {
      const parts = [];
      let length = 0;
      for await (const part of chunksOf(response)) {
        silence?.begin();
        length += part.length;
        if (length > limit) throw refuse();
        parts.push(part);
      }
      return joined(parts, length);
    } catch (cause) {
      if (silence?.isTooLong) throw this.#unanswered(cause);
      if (isAbort(cause) || cause instanceof IsvFailure) throw cause;
      throw new IsvFailure('missing', `${this.name}: the connection broke off`, { cause });
    } finally {
      silence?.end();
    }
  }
}

/** The last part of an address, for people. @param {string} url */
export function nameOf(url) {
  const name = url.split(/[?#]/)[0].split('/').pop() || url;
  try {
    return decodeURIComponent(name);
  } catch {
    return name; // A percent sign that stands for itself.
  }
}

/** The parts of a body as they come: not every browser iterates over bodies. @param {Response} response */
export async function* chunksOf(response) {
  const reader = response.body?.getReader();
  if (!reader) return;
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      yield value;
    }
  } finally {
    reader.cancel().catch(() => {});
  }
}

/** @param {Uint8Array[]} parts @param {number} length */
export function joined(parts, length) {
  if (parts.length === 1) return parts[0];
  const bytes = new Uint8Array(length);
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}
