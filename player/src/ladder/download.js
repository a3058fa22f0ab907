// Whole files by HTTP.

import { IsvFailure, isAbort, words } from '../failure.js';
import { chunksOf, joined, nameOf } from '../ranges.js';

/**
 * @param {string} url
 * @param {object} options
 * @param {number} options.limit most bytes
 * @param {AbortSignal} [options.signal]
 * @param {(got: number, length: number) => void} [options.progress] bytes that are there, and all; 0 if that is not known
 * @returns {Promise<Uint8Array>}
 */
export async function download(url, { limit, signal, progress }) {
  const name = nameOf(url);
  let response;
  try {
    response = await fetch(url, { signal });
  } catch (cause) {
    if (isAbort(cause)) throw cause;
    throw new IsvFailure('missing', `${name} cannot be fetched: ${words(cause)}`, { cause });
  }
  if (!response.ok) {
    const why = response.status === 404 ? 'the server has no such file' : `the server says ${response.status} ${response.statusText}`;
    throw new IsvFailure('missing', `${name}: ${why}`.trim());
  }
  const length = Number(response.headers.get('content-length') ?? 0);
  const parts = [];
  let got = 0;
  try {
    for await (const part of chunksOf(response)) {
      got += part.length;
      if (got > limit) throw new IsvFailure('limit', `${name} has more than ${limit} bytes`);
      parts.push(part);
      progress?.(got, length);
    }
  } catch (cause) {
    if (isAbort(cause) || cause instanceof IsvFailure) throw cause;
    throw new IsvFailure('missing', `${name}: the connection broke off`, { cause });
  }
  return joined(parts, got);
}
