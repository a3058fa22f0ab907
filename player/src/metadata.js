// What a take says of itself: a skippable packet before its first frame, with JSON.

import { UPS } from './axes.js';

const PACKET_HEADER_BYTES = 24;
/** First bytes of a packet, where its type stands, and where the bytes of its payload. */
const MAGIC = 'ISVP';
const TYPE_AT = 4;
const PAYLOAD_LENGTH_AT = 8;
/** Type of the packet. */
const METADATA = 0x80;
/** Most bytes that are looked at. */
export const METADATA_LIMIT = 1 << 20;
/** Most characters of a text. */
const TEXT_LIMIT = 1000;

/** Keys with words. */
const TEXTS = /** @type {const} */ (['title', 'unit', 'device', 'colour_space', 'encoder']);
/** Keys with whatever their writer knows. */
const FREE = /** @type {const} */ (['settings', 'surface']);

/**
 * What a take says of itself. All of it may be missing.
 * @typedef {object} Metadata
 * @property {string} [title]
 * @property {import('./axes.js').Up} [up] the axis of the capture that points up
 * @property {string} [unit] of the capture's files
 * @property {string} [device] what captured it
 * @property {string} [colour_space]
 * @property {[number, number, number]} [origin] place of the capture's origin in metres
 * @property {string} [encoder]
 * @property {unknown} [settings] of the encoder
 * @property {unknown} [surface] what was made of the capture's surface
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
    if (packets[at + TYPE_AT] === METADATA) return parsed(packets.subarray(begin, end));
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
  if (typeof json !== 'object' || json === null) return {};
  /** @type {Metadata} */
  const metadata = {};
  for (const key of TEXTS) {
    const text = json[key];
    if (typeof text === 'string' && text && text.length <= TEXT_LIMIT) metadata[key] = text;
  }
  for (const key of FREE) if (Object.hasOwn(json, key)) metadata[key] = json[key];
  if (UPS.includes(json.up)) metadata.up = json.up;
  const { origin } = json;
  if (Array.isArray(origin) && origin.length === 3 && origin.every(Number.isFinite))
    metadata.origin = /** @type {[number, number, number]} */ (origin);
  return metadata;
}
