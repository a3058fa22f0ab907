// What sound is, to whoever plays it.

/**
 * A track of sound, in fragments of MP4.
 * @typedef {object} SoundTrack
 * @property {string} codec what browsers call it, as `opus`
 * @property {number} begin time of the first frame of the take in the times of the fragments, in seconds
 * @property {Float64Array} starts of fragments, in seconds from the first frame of the take, ascending
 * @property {() => Promise<Uint8Array>} init what comes before the first fragment
 * @property {(at: number, signal: AbortSignal) => Promise<Uint8Array>} fragment
 *
 * @typedef {SoundTrack[]} SoundTracks the first that a browser can play is played
 */

/** Names of codecs, by how what a browser calls them begins. */
const NAMES = /** @type {[string, string][]} */ ([
  ['mp4a.40', 'AAC'],
  ['mp4a.6', 'MP3'],
  ['opus', 'Opus'],
  ['flac', 'FLAC'],
  ['ipcm', 'PCM'],
]);

/** What browsers call MP3 by itself. */
export const MP3_TYPE = 'audio/mpeg';

/** Types under which browsers may take a codec, the best first. @param {string} codec */
export function typesOf(codec) {
  const inMp4 = `audio/mp4; codecs="${codec}"`;
  // Frames of MP3 need no MP4 around them, and not all browsers take them in it.
  return /^mp4a\.6[9b]$/i.test(codec) ? [inMp4, MP3_TYPE] : [inMp4];
}

/** @param {string} codec */
export function nameOfCodec(codec) {
  return NAMES.find(([begin]) => codec.startsWith(begin))?.[1] ?? codec;
}

export {};
