// A take in an MP4 file (docs/spec/mp4.md): the same as one in a stream, with sound and exact times.

import { IsvFailure } from '../failure.js';
import { FrameTimes } from '../frame-times.js';
import { METADATA_LIMIT, metadataOf } from '../metadata.js';
import { BOX_HEADER_BYTES, LARGE_HEADER_BYTES, boxAt, broken, headerAt } from './boxes.js';
import { addSamples, entriesIn, noSamples, samplesIn, tracksIn } from './fragments.js';
import { codecOf, readMovie, soundInit } from './movie.js';

/** @typedef {import('../ranges.js').Bytes} Bytes @typedef {import('./boxes.js').Box} Box @typedef {import('./movie.js').Movie} Movie */

const STREAM_HEADER_BYTES = 48;
const PACKET_HEADER_BYTES = 24;
/** Largest movie box read into memory: metadata and a page for each track are far less. */
const MOVIE_LIMIT = 1 << 24;
/** Largest box of a fragment, and largest fragment of sound. */
const MOOF_LIMIT = 1 << 24;
const SOUND_LIMIT = 1 << 26;
/** Largest table at the end of a file: 16 bytes a frame. */
const TABLE_LIMIT = 1 << 28;
/** Most boxes of a file. */
const BOX_LIMIT = 1 << 21;
/** Bytes of the last box, which says where the table begins. */
const MFRO_BYTES = 16;

/**
 * Place of a fragment of sound: from the first byte of its `moof` to before the next fragment. Its first sample's time is in units of
 * the track.
 * @typedef {{ from: number, to: number, time: number }} Place
 */

/**
 * Reads what an MP4 file has of a take.
 * @param {Bytes} bytes that are open
 * @param {number} length
 * @returns {Promise<import('../source.js').Table & { header: Uint8Array }>}
 */
export async function readTake(bytes, length) {
  const { movie, end } = await readHead(bytes, length);
  const table = (await readEnd(bytes, length, movie)) ?? (await walk(bytes, length, movie, end));
  const { offsets, sizes, keyframes, starts } = table.samples;
  if (offsets.length === 0) throw new IsvFailure('damaged', `${bytes.name} has no frames`);
  const { timescale } = movie.geometry;
  const begin = starts[0] / timescale;
  return {
    header: movie.isvC.slice(0, STREAM_HEADER_BYTES),
    offsets: Float64Array.from(offsets),
    sizes: Float64Array.from(sizes),
    keyframes: Uint8Array.from(keyframes),
    indexed: table.indexed,
    times: new FrameTimes(Float64Array.from(starts, (start) => start / timescale - begin)),
    metadata: metadataOf(movie.isvC.subarray(STREAM_HEADER_BYTES, METADATA_LIMIT)),
    sound: soundsFrom(bytes, movie, table.places, begin),
  };
}

/** What precedes the fragments. @param {Bytes} bytes @param {number} length @returns {Promise<{ movie: Movie, end: number }>} */
async function readHead(bytes, length) {
  /** @type {Uint8Array | null} */
  let ftyp = null;
  for await (const { type, start, end } of boxesOf(bytes, length, 0)) {
    if (type !== 'ftyp' && type !== 'moov') continue;
    if (end - start > MOVIE_LIMIT || end > length) throw broken(`its box ${type} has ${end - start} bytes`);
    const whole = (await bytes.read(start, end)).slice();
    if (type === 'ftyp') ftyp ??= whole;
    else return { movie: readMovie(boxAt(whole, 0), ftyp ?? new Uint8Array(), bytes.name), end };
  }
  throw broken('it has no tracks');
}

/** @typedef {{ samples: import('./fragments.js').Samples, places: Map<number, Place[]>, indexed: boolean }} Found */

/** The tables at the end. @param {Bytes} bytes @param {number} length @param {Movie} movie @returns {Promise<Found | null>} null without good ones */
async function readEnd(bytes, length, { geometry, sounds }) {
  try {
    const mfro = boxAt(await bytes.read(length - MFRO_BYTES, length), 0);
    if (mfro.type !== 'mfro') return null;
    const size = mfro.u32(4);
    if (size > TABLE_LIMIT || size > length) return null;
    const begin = length - size;
    const mfra = boxAt(await bytes.read(begin, length), 0);
    const isvi = mfra.child('isvi');
    if (mfra.type !== 'mfra' || !isvi) return null;
    const samples = samplesIn(isvi, geometry.id, begin, PACKET_HEADER_BYTES);
    const entries = entriesIn(mfra).filter(({ moof }) => moof < begin);
    const places = placesFor(sounds);
    entries.forEach(({ track, time, moof }, at) => places.get(track)?.push({ from: moof, to: entries[at + 1]?.moof ?? begin, time }));
    return { samples, places, indexed: true };
  } catch (error) {
    // The fragments say the same.
    if (error instanceof IsvFailure && error.kind === 'damaged') return null;
    throw error;
  }
}

/** Goes from fragment to fragment, as far as they are good. @param {Bytes} bytes @param {number} length @param {Movie} movie @param {number} from @returns {Promise<Found>} */
async function walk(bytes, length, { geometry, sounds }, from) {
  const samples = noSamples();
  const places = placesFor(sounds);
  /** Places that lack their end. @type {Place[]} */
  let open = [];
  try {
    for await (const { type, start, end } of boxesOf(bytes, length, from)) {
      if (type === 'mdat') {
        for (const place of open) place.to = end;
        open = [];
      }
      if (type !== 'moof') continue;
      if (end - start > MOOF_LIMIT || end > length) throw broken(`a fragment has a box of ${end - start} bytes`);
      const moof = boxAt(await bytes.read(start, end), 0);
      for (const { track, traf, time } of tracksIn(moof)) {
        const sound = places.get(track);
        if (sound) open.push(sound[sound.push({ from: start, to: 0, time }) - 1]);
        if (track !== geometry.id) continue;
        const all = addSamples(samples, traf, { track: geometry, moofAt: start, time, length, least: PACKET_HEADER_BYTES });
        if (!all) throw broken('it ends early');
      }
    }
  } catch (error) {
    // It plays up to where it is damaged or cut.
    if (!(error instanceof IsvFailure && error.kind === 'damaged')) throw error;
  }
  for (const sound of places.values()) while (sound.length && !(sound[sound.length - 1].to <= length && sound[sound.length - 1].to > 0)) sound.pop();
  return { samples, places, indexed: false };
}

/** @param {import('./movie.js').Track[]} sounds @returns {Map<number, Place[]>} by track */
function placesFor(sounds) {
  return new Map(sounds.map(({ id }) => [id, []]));
}

/**
 * Sound as a media element takes it.
 * @param {Bytes} bytes
 * @param {Movie} movie
 * @param {Map<number, Place[]>} places
 * @param {number} begin time of the first frame in seconds
 * @returns {import('../sound/tracks.js').SoundTracks | null}
 */
function soundsFrom(bytes, movie, places, begin) {
  const tracks = movie.sounds.flatMap((track) => {
    const of = (places.get(track.id) ?? []).sort((a, b) => a.time - b.time);
    if (!of.length) return [];
    const init = soundInit(movie, track);
    return [
      {
        codec: codecOf(track),
        begin,
        starts: Float64Array.from(of, ({ time }) => (time + track.shift) / track.timescale - begin),
        init: async () => init,
        fragment: (/** @type {number} */ at, /** @type {AbortSignal} */ signal) => soundFragment(bytes, of[at], track.id, signal),
      },
    ];
  });
  return tracks.length ? tracks : null;
}

/** A fragment of a sound track, alone. @param {Bytes} bytes @param {Place} place @param {number} track @param {AbortSignal} signal */
async function soundFragment(bytes, { from, to }, track, signal) {
  if (to - from > SOUND_LIMIT) throw new IsvFailure('limit', `a fragment of sound has ${to - from} bytes`);
  const part = await bytes.readAlone(from, to, signal);
  const moof = boxAt(part, 0);
  if (moof.type !== 'moof' || tracksIn(moof).some((one) => one.track !== track)) throw broken('sound does not lie by itself');
  let at = moof.end;
  for (;;) {
    const box = boxAt(part, at);
    at = box.end;
    if (box.type === 'mdat') return part.slice(0, at);
  }
}

/** Boxes of a file, one after the other. @param {Bytes} bytes @param {number} length @param {number} from @returns {AsyncGenerator<{ type: string, start: number, end: number }>} */
async function* boxesOf(bytes, length, from) {
  let at = from;
  for (let boxes = 0; at + BOX_HEADER_BYTES <= length; boxes++) {
    if (boxes === BOX_LIMIT) throw broken('it has too many boxes');
    const { type, size } = headerAt(await bytes.read(at, Math.min(length, at + LARGE_HEADER_BYTES)), length - at);
    yield { type, start: at, end: at + size };
    at += size;
  }
}
