// Fragments: what a `moof` says of its samples, and the table of all of them at the end of a file.

import { broken } from './boxes.js';

/** @typedef {import('./boxes.js').Box} Box @typedef {import('./movie.js').Track} Track */

/** Most samples of a track: a day and a half at 60 a second. */
export const SAMPLE_LIMIT = 1 << 23;
/** Most fragments of a track. */
const FRAGMENT_LIMIT = 1 << 20;
/** Flags of `tfhd`. */
const HAS_BASE = 0x1;
const HAS_DESCRIPTION = 0x2;
const HAS_DEFAULT_DURATION = 0x8;
const HAS_DEFAULT_SIZE = 0x10;
const HAS_DEFAULT_FLAGS = 0x20;
/** Flags of `trun`. */
const HAS_OFFSET = 0x1;
const HAS_FIRST_FLAGS = 0x4;
const HAS_DURATIONS = 0x100;
const HAS_SIZES = 0x200;
const HAS_FLAGS = 0x400;
const HAS_SHIFTS = 0x800;
/** Flag of a sample that needs others. */
const NO_SYNC = 0x10000;

/**
 * Samples of a track: offsets and bytes, 1 at keyframes, and starts in units of the track's timescale, one more than there are samples.
 * @typedef {{ offsets: number[], sizes: number[], keyframes: number[], starts: number[] }} Samples
 * @typedef {{ track: number, time: number, moof: number }} Entry a fragment, as the table at the end names it
 */

/** @returns {Samples} */
export function noSamples() {
  return { offsets: [], sizes: [], keyframes: [], starts: [] };
}

/** The tracks whose samples a `moof` has. @param {Box} moof @returns {{ track: number, traf: Box, time: number }[]} */
export function tracksIn(moof) {
  const trafs = moof.children().filter(({ type }) => type === 'traf');
  return trafs.map((traf) => {
    const tfhd = traf.child('tfhd');
    const tfdt = traf.child('tfdt');
    if (!tfhd || !tfdt) throw broken('a fragment does not say of which track and time it is');
    return { track: tfhd.u32(4), traf, time: tfdt.version === 1 ? tfdt.u64(4) : tfdt.u32(4) };
  });
}

/**
 * Adds the samples of a fragment. Those that lie beyond the end of the file are left out.
 * @param {Samples} samples
 * @param {Box} traf
 * @param {{ track: Track, moofAt: number, time: number, length: number, least: number }} of where the `moof` begins, the fragment's time, the
 *   bytes of the file, and least bytes of a sample
 * @returns {boolean} whether all of them are there
 */
export function addSamples(samples, traf, { track, moofAt, time, length, least }) {
  const tfhd = /** @type {Box} */ (traf.child('tfhd'));
  const { flags } = tfhd;
  let at = 8;
  const next = (/** @type {number} */ flag, /** @type {number} */ otherwise) => {
    if (!(flags & flag)) return otherwise;
    at += 4;
    return tfhd.u32(at - 4);
  };
  const base = flags & HAS_BASE ? tfhd.u64(at) : moofAt;
  if (flags & HAS_BASE) at += 8;
  next(HAS_DESCRIPTION, 0);
  const defaults = {
    duration: next(HAS_DEFAULT_DURATION, track.defaults.duration),
    size: next(HAS_DEFAULT_SIZE, track.defaults.size),
    flags: next(HAS_DEFAULT_FLAGS, track.defaults.flags),
  };
  let start = Math.max(time, samples.starts[samples.offsets.length] ?? 0);
  let offset = base;
  for (const trun of traf.children().filter(({ type }) => type === 'trun')) {
    const run = runOf(trun);
    if (run.offset !== null) offset = base + run.offset;
    for (let sample = 0; sample < run.samples; sample++) {
      const { duration, size, flags } = run.sample(sample, defaults);
      if (size < least) throw broken(`a sample has ${size} bytes`);
      if (offset < 0 || offset + size > length) return false;
      if (samples.offsets.length === SAMPLE_LIMIT) throw broken('it has too many samples');
      const number = samples.offsets.push(offset) - 1;
      samples.sizes.push(size);
      samples.keyframes.push(flags & NO_SYNC ? 0 : 1);
      samples.starts[number] = start;
      start += duration;
      samples.starts[number + 1] = start;
      offset += size;
    }
  }
  return true;
}

/** @param {Box} trun */
function runOf(trun) {
  const { flags } = trun;
  const samples = trun.u32(4);
  let at = 8;
  const offset = flags & HAS_OFFSET ? trun.i32(at) : null;
  if (flags & HAS_OFFSET) at += 4;
  const first = flags & HAS_FIRST_FLAGS ? trun.u32(at) : null;
  if (flags & HAS_FIRST_FLAGS) at += 4;
  const fields = [HAS_DURATIONS, HAS_SIZES, HAS_FLAGS, HAS_SHIFTS].filter((flag) => flags & flag);
  const stride = 4 * fields.length;
  if (stride && at + samples * stride > trun.length) throw broken('a run of samples is cut');
  const field = (/** @type {number} */ flag, /** @type {number} */ sample) =>
    flags & flag ? trun.u32(at + sample * stride + 4 * fields.indexOf(flag)) : null;
  return {
    samples,
    offset,
    /** @param {number} sample @param {{ duration: number, size: number, flags: number }} defaults */
    sample: (sample, defaults) => ({
      duration: field(HAS_DURATIONS, sample) ?? defaults.duration,
      size: field(HAS_SIZES, sample) ?? defaults.size,
      flags: (sample === 0 ? first : null) ?? field(HAS_FLAGS, sample) ?? defaults.flags,
    }),
  };
}

/** Fragments that `tfra` boxes name. @param {Box} mfra @returns {Entry[]} in the order of the file */
export function entriesIn(mfra) {
  /** @type {Map<number, Entry>} */
  const entries = new Map();
  for (const tfra of mfra.children().filter(({ type }) => type === 'tfra')) {
    const track = tfra.u32(4);
    const lengths = tfra.u32(8);
    const wide = tfra.version === 1 ? 8 : 4;
    const stride = 2 * wide + 3 + ((lengths >> 4) & 3) + ((lengths >> 2) & 3) + (lengths & 3);
    const count = tfra.u32(12);
    if (count > FRAGMENT_LIMIT || 16 + count * stride > tfra.length) throw broken('the table of fragments is cut');
    const number = (/** @type {number} */ at) => (wide === 8 ? tfra.u64(at) : tfra.u32(at));
    for (let entry = 0; entry < count; entry++) {
      const at = 16 + entry * stride;
      entries.set(number(at + wide), { track, time: number(at), moof: number(at + wide) });
    }
  }
  return [...entries.values()].sort((a, b) => a.moof - b.moof);
}

/** Samples that `isvi` lists. @param {Box} isvi @param {number} track @param {number} length bytes of the file @param {number} least bytes of a sample @returns {Samples} */
export function samplesIn(isvi, track, length, least) {
  const count = isvi.u32(16);
  if (isvi.version !== 0 || isvi.u32(4) !== track) throw broken('the table of frames is of another track');
  if (count > SAMPLE_LIMIT || 20 + 16 * count > isvi.length) throw broken('the table of frames is cut');
  const samples = noSamples();
  samples.starts.push(isvi.u64(8));
  for (let sample = 0; sample < count; sample++) {
    const at = 20 + 16 * sample;
    // Twice an offset is above 2^53 only of what is no offset.
    const place = isvi.u64(at);
    const size = isvi.u32(at + 8);
    const offset = Math.floor(place / 2);
    if (size < least || offset + size > length) throw broken(`frame ${sample} is not in the file`);
    samples.offsets.push(offset);
    samples.sizes.push(size);
    samples.keyframes.push(place % 2);
    samples.starts.push(samples.starts[sample] + isvi.u32(at + 12));
  }
  return samples;
}
