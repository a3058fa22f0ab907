// The movie box: which tracks a file has, and what a decoder of each needs.

import { IsvFailure } from '../failure.js';
import { broken, made } from './boxes.js';

/** @typedef {import('./boxes.js').Box} Box */

/** Bytes of a stream header, and of what stands before the boxes of a sample entry. */
const STREAM_HEADER_BYTES = 48;
const ISV_ENTRY_BYTES = 40;
const SOUND_ENTRY_BYTES = 28;
/** Most tracks: one of geometry and 15 others. */
const TRACK_LIMIT = 16;
/** Tags of an `esds` box. */
const ES_DESCRIPTOR = 3;
const DECODER_CONFIG = 4;
const DECODER_SPECIFIC = 5;
/** Kinds of sound that `esds` names. */
const AAC = 0x40;

/**
 * A track.
 * @typedef {object} Track
 * @property {number} id
 * @property {number} timescale units of its times a second
 * @property {Box} entry its sample entry
 * @property {Box} trak
 * @property {number} shift what to add to the track's times, in its units, to have those of the movie
 * @property {{ duration: number, size: number, flags: number }} defaults of samples
 *
 * @typedef {{ geometry: Track, isvC: Uint8Array, sounds: Track[], ftyp: Uint8Array, moov: Box }} Movie isvC: the stream before its first frame
 */

/** Reads tracks. @param {Box} moov @param {Uint8Array} ftyp @param {string} name of the file @returns {Movie} */
export function readMovie(moov, ftyp, name) {
  const traks = moov.children().filter(({ type }) => type === 'trak');
  if (traks.length > TRACK_LIMIT) throw broken(`it has ${traks.length} tracks`);
  const tracks = traks.map((trak) => trackOf(trak, moov)).filter((track) => track !== null);
  const geometry = tracks.find(({ entry }) => entry.type === 'isv1');
  if (!geometry) throw new IsvFailure('not-isv', `${name} is an MP4 file without isv geometry`);
  const config = geometry.entry.child('isvC', ISV_ENTRY_BYTES);
  if (!config || config.length < STREAM_HEADER_BYTES) throw broken('the track of geometry has no stream header');
  const isvC = config.bytes.slice(config.body, config.end);
  return { geometry, isvC, sounds: tracks.filter(isSound), ftyp, moov };
}

/** Tracks of a file that has no geometry, as of the sound of a ladder. @param {Box} moov @returns {Track[]} */
export function soundsOf(moov) {
  const traks = moov.children().filter(({ type }) => type === 'trak');
  return traks.slice(0, TRACK_LIMIT).map((trak) => trackOf(trak, moov)).filter((track) => track !== null).filter(isSound);
}

/** What a media element is given before the fragments of a sound track. @param {Movie} movie @param {Track} track @returns {Uint8Array} */
export function soundInit({ ftyp, moov }, track) {
  const mvhd = moov.child('mvhd');
  const trex = trexOf(moov, track.id);
  if (!mvhd || !trex) throw broken('it says nothing of its fragments');
  return joined(ftyp, made('moov', mvhd.whole, track.trak.whole, made('mvex', trex.whole)));
}

/**
 * What a browser calls the codec of a sound track (RFC 6381).
 * @param {Track} track
 * @returns {string}
 */
export function codecOf({ entry }) {
  const names = /** @type {Record<string, string>} */ ({ Opus: 'opus', fLaC: 'flac' });
  if (entry.type !== 'mp4a') return names[entry.type] ?? entry.type.trim();
  const esds = entry.child('esds', SOUND_ENTRY_BYTES);
  return esds ? mpegCodec(esds) : 'mp4a';
}

/** @param {Box} esds */
function mpegCodec(esds) {
  // Descriptors lie in one another: a tag, a length in bytes of 7 bits, contents.
  let at = 4;
  for (const [tag, skip] of /** @type {const} */ ([[ES_DESCRIPTOR, 3], [DECODER_CONFIG, 13], [DECODER_SPECIFIC, 0]])) {
    if (esds.u8(at++) !== tag) break;
    for (let byte = 0; byte < 4 && esds.u8(at++) & 0x80; byte++);
    if (tag === DECODER_CONFIG && esds.u8(at) !== AAC) return `mp4a.${esds.u8(at).toString(16).toUpperCase()}`;
    if (tag === DECODER_SPECIFIC) {
      const kind = esds.u8(at) >> 3;
      return `mp4a.40.${kind === 31 ? 32 + (((esds.u8(at) & 7) << 3) | (esds.u8(at + 1) >> 5)) : kind}`;
    }
    at += skip;
  }
  return 'mp4a.40.2';
}

/** @param {Track} track */
function isSound({ trak }) {
  const hdlr = trak.find('mdia', 'hdlr');
  return hdlr !== undefined && hdlr.name(8) === 'soun';
}

/** @param {Box} trak @param {Box} moov @returns {Track | null} null for one that nothing can be said of */
function trackOf(trak, moov) {
  const tkhd = trak.child('tkhd');
  const mdhd = trak.find('mdia', 'mdhd');
  const entry = trak.find('mdia', 'minf', 'stbl', 'stsd')?.children(8)[0];
  if (!tkhd || !mdhd || !entry) return null;
  const id = tkhd.u32(tkhd.version === 1 ? 20 : 12);
  const timescale = mdhd.u32(mdhd.version === 1 ? 20 : 12);
  if (timescale === 0) throw broken(`track ${id} has no timescale`);
  const trex = trexOf(moov, id);
  const defaults = trex ? { duration: trex.u32(12), size: trex.u32(16), flags: trex.u32(20) } : { duration: 0, size: 0, flags: 0 };
  return { id, timescale, entry, trak, shift: shiftOf(trak, moov, timescale), defaults };
}

/** @param {Box} moov @param {number} id */
function trexOf(moov, id) {
  const mvex = moov.child('mvex');
  return mvex?.children().find((box) => box.type === 'trex' && box.u32(4) === id);
}

/** What an edit list says: a wait at first, and what is skipped. @param {Box} trak @param {Box} moov @param {number} timescale */
function shiftOf(trak, moov, timescale) {
  const elst = trak.find('edts', 'elst');
  const mvhd = moov.child('mvhd');
  if (!elst || !mvhd) return 0;
  const movieScale = mvhd.u32(mvhd.version === 1 ? 20 : 12) || 1;
  const large = elst.version === 1;
  const edits = Math.min(elst.u32(4), 2);
  let shift = 0;
  for (let edit = 0; edit < edits; edit++) {
    const at = 8 + edit * (large ? 20 : 12);
    const skipped = large ? elst.i64(at + 8) : elst.i32(at + 4);
    if (skipped >= 0) return shift - skipped;
    shift += ((large ? elst.u64(at) : elst.u32(at)) * timescale) / movieScale;
  }
  return shift;
}

/** @param {Uint8Array} a @param {Uint8Array} b */
function joined(a, b) {
  const both = new Uint8Array(a.length + b.length);
  both.set(a);
  both.set(b, a.length);
  return both;
}
