// Attempts at a segment: what is tried again, and how often.

import { IsvFailure, LostPart, isAbort, words } from '../failure.js';
import { nameOf } from '../ranges.js';
import { NoAnswer, answers } from './download.js';

/** Waits in ms before a segment is tried again: a server that is busy for a moment needs no other segment. */
const WAITS = [200, 800];

/**
 * Gets a segment, again where that fails.
 * @template T
 * @param {string} url of the segment
 * @param {(again: boolean) => Promise<T>} attempt again: whether one before it failed
 * @param {object} how
 * @param {AbortSignal} how.signal
 * @param {string} how.witness a file of the same server that is there: whether the server answers at all
 * @param {boolean} [how.once] whether it is tried only once
 * @returns {Promise<T>} rejects with a `LostPart`, or with a `NoAnswer` where no other file would come either
 */
export async function attempts(url, attempt, { signal, witness, once = false }) {
  for (let failed = 0; ; failed++) {
    try {
      return await attempt(failed > 0);
    } catch (error) {
      if (signal.aborted || isAbort(error)) throw error;
      // Some servers refuse a file in a way that a page may not see: then only other files are answered.
      if (error instanceof NoAnswer && !(await answers(witness, signal))) throw error;
      if (once || failed === WAITS.length) throw lost(url, error);
      await pause(WAITS[failed], signal);
    }
  }
}

/** @param {string} url @param {unknown} error */
function lost(url, error) {
  const kind = error instanceof IsvFailure ? error.kind : 'damaged';
  const why = words(error);
  return new LostPart(kind, why.startsWith(nameOf(url)) ? why : `${nameOf(url)}: ${why}`, { cause: error });
}

/** @param {number} ms @param {AbortSignal} signal */
function pause(ms, signal) {
  return new Promise((/** @type {(value: void) => void} */ resolve, reject) => {
    signal.throwIfAborted();
    const leave = () => {
      clearTimeout(timer);
      reject(signal.reason);
    };
    const timer = setTimeout(() => {
      signal.removeEventListener('abort', leave);
      resolve();
    }, ms);
    signal.addEventListener('abort', leave, { once: true });
  });
}
