// What each of the takes on the page may use of the machine.

import { parseMemory } from '../allowance.js';

/** Bytes of decoded frames that all takes hold together. */
const MEMORY = 384 << 20;

/** @param {number} takes how many there are @returns {{ memory: number, workers: number }} */
export function shareOf(takes) {
  const cores = Math.min(navigator.hardwareConcurrency || 2, 4);
  return { memory: MEMORY / takes, workers: Math.ceil(cores / takes) };
}

/** Memory for decoding that the page's address gives, in bytes; nothing if it gives none. @param {URLSearchParams} query @returns {{ maxMemory?: number }} */
export function memoryOf(query) {
  const memory = query.get('max-memory');
  return memory === null ? {} : { maxMemory: parseMemory(memory) };
}

/** Files that the page's address names: one, or two to be compared. @param {URLSearchParams} query @returns {string[]} */
export function filesOf(query) {
  return [query.get('src'), query.get('compare')].filter((url) => url !== null);
}
