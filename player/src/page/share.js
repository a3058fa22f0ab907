// What each of the takes on the page may use of the machine.

import { parseMemory } from '../allowance.js';

/** Bytes of decoded frames that all takes hold together, and most decoders. A phone closes pages that take far more. */
const LARGE = { memory: 384 << 20, workers: 4 };
const PHONE = { memory: 64 << 20, workers: 2 };
/** Width or height of a phone at most, in pixels of CSS. */
const PHONE_SIDE = 600;

/** @param {number} takes how many there are @returns {{ memory: number, workers: number }} */
export function shareOf(takes) {
  const isPhone = matchMedia('(pointer: coarse)').matches && Math.min(screen.width, screen.height) <= PHONE_SIDE;
  const { memory, workers } = isPhone ? PHONE : LARGE;
  const decoders = Math.min(navigator.hardwareConcurrency || 2, workers);
  return { memory: memory / takes, workers: Math.ceil(decoders / takes) };
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
