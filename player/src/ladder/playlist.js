// Playlists of HTTP Live Streaming (RFC 8216), as far as ladders of isv need them (docs/spec/mp4.md, 5).

import { IsvFailure } from '../failure.js';

/** Most characters and lines of a playlist. */
export const PLAYLIST_LIMIT = 1 << 22;
const LINE_LIMIT = 1 << 19;
/** Most rungs, segments and frames of a segment. */
const RUNG_LIMIT = 16;
const SEGMENT_LIMIT = 1 << 17;
const FRAME_LIMIT = 1 << 16;
/** Longest segment in seconds. */
const LONGEST = 3600;
/** What this player cannot do: parts of files, encryption, streams that begin anew. */
const UNSUPPORTED = ['#EXT-X-BYTERANGE', '#EXT-X-DISCONTINUITY', '#EXT-X-I-FRAMES-ONLY'];

/**
 * @typedef {{ url: string, bandwidth: number, codecs: string, sound: string | null }} RungFacts bits a second at most, and the group of its sound
 * @typedef {{ rungs: RungFacts[], sounds: Map<string, string> }} Master rungs, the best first, and playlists of sound by their group
 * @typedef {{ url: string, seconds: number, frames: number }} Segment frames: 0 where it does not say
 * @typedef {{ init: string, segments: Segment[] }} Media
 */

/** Whether a playlist lists rungs, not segments. @param {string} text */
export function isMaster(text) {
  return text.includes('#EXT-X-STREAM-INF');
}

/** @param {string} text @param {string} url where it was @returns {Master} */
export function parseMaster(text, url) {
  /** @type {RungFacts[]} */
  const rungs = [];
  const sounds = new Map();
  /** @type {Record<string, string> | null} */
  let rung = null;
  for (const line of linesOf(text)) {
    const { tag, value } = tagOf(line);
    const attributes = tag === '#EXT-X-STREAM-INF' || tag === '#EXT-X-MEDIA' ? attributesOf(value) : {};
    if (tag === '#EXT-X-STREAM-INF') rung = attributes;
    if (tag === '#EXT-X-MEDIA' && attributes.TYPE === 'AUDIO' && attributes.URI && sounds.size < RUNG_LIMIT) {
      const group = attributes['GROUP-ID'] ?? '';
      if (!sounds.has(group) || attributes.DEFAULT === 'YES') sounds.set(group, absolute(attributes.URI, url));
    }
    if (tag || !rung) continue;
    const bandwidth = Number(rung.BANDWIDTH);
    if (!(bandwidth > 0 && bandwidth < 1e12)) throw broken('a rung has no bandwidth');
    const codecs = rung.CODECS ?? '';
    // Other streams beside those of geometry, as a picture.
    if (!codecs || /(^|,)\s*isv1/.test(codecs)) rungs.push({ url: absolute(line, url), bandwidth, codecs, sound: rung.AUDIO ?? null });
    rung = null;
    if (rungs.length > RUNG_LIMIT) throw broken(`it has more than ${RUNG_LIMIT} rungs`);
  }
  if (!rungs.length) throw new IsvFailure('not-isv', 'the playlist has no isv geometry');
  return { rungs: rungs.sort((a, b) => b.bandwidth - a.bandwidth), sounds };
}

/** @param {string} text @param {string} url where it was @returns {Media} */
export function parseMedia(text, url) {
  let init = '';
  /** @type {Segment[]} */
  const segments = [];
  let seconds = 0;
  let frames = 0;
  for (const line of linesOf(text)) {
    const { tag, value } = tagOf(line);
    const encrypted = tag === '#EXT-X-KEY' && attributesOf(value).METHOD !== 'NONE';
    if (encrypted || UNSUPPORTED.includes(tag)) throw new IsvFailure('unsupported', `this player knows no playlists with ${tag.slice(1)}`);
    if (tag === '#EXT-X-MAP') {
      const { URI, BYTERANGE } = attributesOf(value);
      if (init || BYTERANGE || !URI) throw new IsvFailure('unsupported', 'this player knows no playlists whose header changes or lies in a part of a file');
      init = absolute(URI, url);
    }
    if (tag === '#EXTINF') seconds = parseFloat(value);
    if (tag === '#EXT-X-ISV-FRAMES') frames = Number(value);
    if (tag) continue;
    if (!(seconds > 0 && seconds <= LONGEST)) throw broken('a segment has no duration');
    if (!(Number.isInteger(frames) && frames >= 0 && frames <= FRAME_LIMIT)) throw broken('a segment has no number of frames');
    if (segments.push({ url: absolute(line, url), seconds, frames }) > SEGMENT_LIMIT) throw broken('it has too many segments');
    seconds = 0;
    frames = 0;
  }
  if (!init || !segments.length) throw broken('it has no segments');
  return { init, segments };
}

/** Lines that are not empty and no comments. @param {string} text */
function linesOf(text) {
  if (text.length > PLAYLIST_LIMIT) throw broken('it is too long');
  const lines = text.split('\n', LINE_LIMIT + 1);
  if (lines.length > LINE_LIMIT) throw broken('it has too many lines');
  if (!lines[0].startsWith('#EXTM3U')) throw broken('it does not begin as one');
  return lines.slice(1).map((line) => line.trim()).filter((line) => line && (!line.startsWith('#') || line.startsWith('#EXT')));
}

/** @param {string} line @returns {{ tag: string, value: string }} an empty tag where the line is an address */
function tagOf(line) {
  if (!line.startsWith('#')) return { tag: '', value: line };
  const colon = line.indexOf(':');
  return colon < 0 ? { tag: line, value: '' } : { tag: line.slice(0, colon), value: line.slice(colon + 1) };
}

/** @param {string} list @returns {Record<string, string>} */
function attributesOf(list) {
  const pairs = [...list.matchAll(/([A-Z0-9-]{1,64})=(?:"([^"]*)"|([^",]*))/g)].map(([, name, quoted, plain]) => [name, quoted ?? plain]);
  return Object.assign(Object.create(null), Object.fromEntries(pairs));
}

/** @param {string} address @param {string} base */
function absolute(address, base) {
  const url = URL.canParse(address, base) ? new URL(address, base) : null;
  if (url?.protocol !== 'http:' && url?.protocol !== 'https:') throw broken(`${address.slice(0, 100)} is no address`);
  return url.href;
}

/** @param {string} why */
function broken(why) {
  return new IsvFailure('damaged', `the playlist is damaged: ${why}`);
}
