// What a take says of itself: a skippable packet before its first frame, with JSON.

import { isUp } from './axes.js';

const PACKET_HEADER_BYTES = 24;
/** First bytes of a packet, where its type stands, and where the bytes of its payload. */
const MAGIC = 'ISVP';
const TYPE_AT = 4;
const PAYLOAD_LENGTH_AT = 8;
/** Type of the packet. */
const METADATA = 0x80;
/** Most bytes of packets before the first frame that are looked at, and most bytes of metadata. */
export const METADATA_LIMIT = 1 << 20;
const PAYLOAD_LIMIT = 1 << 16;
/** Most characters of a text. */
const TEXT_LIMIT = 1000;

/** What a value must be like to be taken. @type {Record<string, (value: any) => boolean>} */
const TAKEN = {
  title: isText,
  unit: isText,
  device: isText,
  colour_space: isText,
  encoder: isText,
  up: isUp,
  origin: (value) => Array.isArray(value) && value.length === 3 && value.every(Number.isFinite),
  source: isObject,
  surface: isObject,
  settings: isObject,
};

/**
 * What a take says of itself (docs/spec/format.md, 6.8). All of it may be missing; keys that are not listed here are kept.
 * @typedef {object} Metadata
 * @property {string} [title]
 * @property {import('./axes.js').Up} [up] the axis of the stream's coordinates that points up
 * @property {string} [unit] of the stream's coordinates
 * @property {string} [device] what captured it
 * @property {string} [colour_space]
 * @property {[number, number, number]} [origin] place of the stream's origin in the coordinates of the capture, in metres
 * @property {string} [encoder]
 * @property {object} [source] unit and axis of the capture
 * @property {object} [surface] what was decided on the capture's surface
 * @property {object} [settings] of the encoder
 */

/**
 * The metadata among the packets before the first frame.
 * @param {Uint8Array} packets whole packets, one after the other
 * @returns {Metadata} empty where there is none, or none that can be read
 */
export function metadataOf(packets) {
  const view = new DataView(packets.buffer, packets.byteOffset, packets.byteLength);
  for (let at = 0; at + PACKET_HEADER_BYTES <= packets.length; ) {
    const magic = String.fromCharCode(...packets.subarray(at, at + MAGIC.length));
    const begin = at + PACKET_HEADER_BYTES;
    const end = begin + view.getUint32(at + PAYLOAD_LENGTH_AT, true);
    if (magic !== MAGIC || end > packets.length) break;
    if (packets[at + TYPE_AT] === METADATA && end - begin <= PAYLOAD_LIMIT) return parsed(packets.subarray(begin, end));
    at = end;
  }
  return {};
}

/** @param {Uint8Array} payload @returns {Metadata} */
function parsed(payload) {
  let json;
  try {
    json = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(payload));
  } catch {
    return {}; // What cannot be read says nothing; the take plays without.
  }
  if (!isObject(json)) return {};
  const kept = Object.entries(json).filter(([key, value]) => !Object.hasOwn(TAKEN, key) || TAKEN[key](value));
  return Object.fromEntries(kept);
}

/** @param {unknown} value */
function isText(value) {
  return typeof value === 'string' && value !== '' && value.length <= TEXT_LIMIT;
}

/** @param {unknown} value */
function isObject(value) {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}
