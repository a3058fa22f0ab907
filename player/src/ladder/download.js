// Whole files by HTTP.

import { IsvFailure, isAbort, words } from '../failure.js';
import { chunksOf, joined, nameOf } from '../ranges.js';
import { SILENCE, Silence } from '../silence.js';

/** Wait for a sign of a server, in ms. */
const SIGN = 5000;

/** Nothing came at all, so that it is not known whether the file or the network is missing. */
export class NoAnswer extends IsvFailure {}

/**
 * @param {string} url
 * @param {object} options
 * @param {number} options.limit most bytes
 * @param {AbortSignal} [options.signal]
 * @param {boolean} [options.again] whether an earlier download failed: what the browser has kept of it is passed by
 * @param {number} [options.silence] ms without a byte after which it is given up
 * @param {(got: number, length: number) => void} [options.progress] bytes that are there, and all; 0 if that is not known
 * @returns {Promise<Uint8Array>}
 */
export async function download(url, { limit, signal, again = false, silence = SILENCE, progress }) {
  const name = nameOf(url);
  const quiet = new Silence(silence);
  let answered = false;
  const failed = (/** @type {unknown} */ cause) => {
    if (signal?.aborted || cause instanceof IsvFailure) return cause;
    if (quiet.isTooLong) return new NoAnswer('missing', `${name}: the server sends nothing`, { cause });
    if (isAbort(cause)) return cause;
    if (answered) return new IsvFailure('missing', `${name}: the connection broke off`, { cause });
    return new NoAnswer('missing', `${name} cannot be fetched: ${words(cause)}`, { cause });
  };
  try {
    const signals = [quiet.signal, ...(signal ? [signal] : [])];
    const response = await fetch(url, { signal: AbortSignal.any(signals), cache: again ? 'reload' : 'default' });
    answered = true;
    if (!response.ok) {
      response.body?.cancel().catch(() => {});
      const why = response.status === 404 ? 'the server has no such file' : `the server says ${response.status} ${response.statusText}`;
      throw new IsvFailure('missing', `${name}: ${why}`.trim());
    }
    const length = Number(response.headers.get('content-length') ?? 0);
    const parts = [];
    let got = 0;
    for await (const part of chunksOf(response)) {
      quiet.begin();
      got += part.length;
      if (got > limit) throw new IsvFailure('limit', `${name} has more than ${limit} bytes`);
      parts.push(part);
      progress?.(got, length);
    }
    return joined(parts, got);
  } catch (cause) {
    throw failed(cause);
  } finally {
    quiet.end();
  }
}

/** Whether a server answers a request for a file, whatever it says. @param {string} url @param {AbortSignal} signal */
export async function answers(url, signal) {
  try {
    const response = await fetch(url, { cache: 'no-store', signal: AbortSignal.any([signal, AbortSignal.timeout(SIGN)]) });
    response.body?.cancel().catch(() => {});
    return true;
  } catch {
    signal.throwIfAborted();
    return false;
  }
}
