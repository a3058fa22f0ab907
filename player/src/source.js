/** A stream in a file: its header, where its frames are, and their packets. */

import { Gops } from './gops.js';
import { IsvFailure } from './failure.js';
import { IsvError } from './wasm.js';

const STREAM_HEADER_BYTES = 48;
const PACKET_HEADER_BYTES = 24;
const TRAILER_BYTES = 16;
/** Where a packet header states the bytes of its payload. */
const PAYLOAD_LENGTH_AT = 8;
/** Largest packet read into memory. */
const PACKET_LIMIT = 1 << 28;
/** Most frames of a file: three days at 60 a second. */
const FRAME_LIMIT = 1 << 24;
/** Largest index read into memory: 8 bytes a frame. */
const INDEX_LIMIT = PACKET_HEADER_BYTES + 8 * FRAME_LIMIT;

/**
 * @typedef {import('./wasm.js').StreamFacts} StreamFacts
 * @typedef {import('./ranges.js').Bytes} Bytes
 * @typedef {Pick<import('./wasm.js').Decoder, 'open' | 'parseTrailer' | 'parseIndex' | 'parsePacketHeader'>} Parser
 */

export class FileSource {
  /**
   * @param {Bytes} bytes
   * @param {Uint8Array} header
   * @param {StreamFacts} facts
   * @param {Table} table
   */
  constructor(bytes, header, facts, table) {
    this.bytes = bytes;
    this.name = bytes.name;
    /** The 48 bytes that every decoder is opened with. */
    this.header = header;
    this.facts = facts;
    /** Offset of each frame's packet, and one more: where the last one ends. Packets of unknown types may stand between two of them. */
    this.offsets = table.offsets;
    this.gops = new Gops(table.keyframes);
    /** Whether the file has an index; false if its writer did not finish, or its end was lost. */
    this.indexed = table.indexed;
  }

  /**
   * @param {Bytes} bytes
   * @param {Parser | Promise<Parser>} parser loaded while both ends of the file are read
   * @returns {Promise<FileSource>}
   */
  static async open(bytes, parser) {
    const length = await bytes.open();
    if (length < STREAM_HEADER_BYTES) throw new IsvFailure('not-isv', `${bytes.name} is no .isv file: it has ${length} bytes`);
    const header = (await bytes.read(0, STREAM_HEADER_BYTES)).slice();
    const parse = await parser;
    const facts = opened(parse, header, bytes.name);
    const table = (await readIndex(bytes, length, parse)) ?? (await walk(bytes, length, parse));
    if (table.keyframes.length === 0) throw new IsvFailure('damaged', `${bytes.name} has no frames`);
    return new FileSource(bytes, header, facts, table);
  }

  get frames() {
    return this.gops.frames;
  }

  /** Bytes from a frame's packet to the next one. @param {number} frame */
  bytesOf(frame) {
    return this.offsets[frame + 1] - this.offsets[frame];
  }

  /** Bytes of the packets of frames `from` to before `to`. @param {number} from @param {number} to */
  bytesBetween(from, to) {
    return this.offsets[Math.min(to, this.frames)] - this.offsets[Math.max(0, from)];
  }

  /** A frame's packet, in a buffer of its own. @param {number} frame @param {AbortSignal} [signal] */
  async packet(frame, signal) {
    const size = this.bytesOf(frame);
    if (size > PACKET_LIMIT) throw new IsvFailure('limit', `frame ${frame} has ${size} bytes`);
    const bytes = await this.bytes.read(this.offsets[frame], this.offsets[frame + 1], signal);
    const packet = firstPacket(bytes);
    return packet.byteLength === packet.buffer.byteLength ? packet : packet.slice();
  }

  close() {
    this.bytes.close();
  }
}

/** The packet that bytes begin with, without what follows it; all of them where they are no whole packet. @param {Uint8Array} bytes */
function firstPacket(bytes) {
  if (bytes.byteLength < PACKET_HEADER_BYTES) return bytes;
  const payloadBytes = new DataView(bytes.buffer, bytes.byteOffset).getUint32(PAYLOAD_LENGTH_AT, true);
  return bytes.subarray(0, PACKET_HEADER_BYTES + payloadBytes);
}

/** @param {Parser} parse @param {Uint8Array} header @param {string} name */
function opened(parse, header, name) {
  try {
    return parse.open(header);
  } catch (cause) {
    throw new IsvFailure('not-isv', `${name} is no .isv file that this player knows: ${/** @type {Error} */ (cause).message}`, {
      cause,
    });
  }
}

/**
 * Where the frames are.
 * @typedef {object} Table
 * @property {Float64Array} offsets one more than there are frames
 * @property {Uint8Array} keyframes 1 at keyframes
 * @property {boolean} indexed
 */

/** @param {Bytes} bytes @param {number} length @param {Parser} parse @returns {Promise<Table | null>} null without a good index */
async function readIndex(bytes, length, parse) {
  if (length < STREAM_HEADER_BYTES + PACKET_HEADER_BYTES + TRAILER_BYTES) return null;
  const at = parse.parseTrailer(await bytes.read(length - TRAILER_BYTES, length));
  if (at === undefined || at < STREAM_HEADER_BYTES || at > length - TRAILER_BYTES - PACKET_HEADER_BYTES) return null;
  if (length - TRAILER_BYTES - at > INDEX_LIMIT) return null;
  try {
    const { offsets, keyframes } = parse.parseIndex(await bytes.read(at, length - TRAILER_BYTES), at);
    const ends = new Float64Array(offsets.length + 1);
    ends.set(offsets);
    ends[offsets.length] = at;
    return { offsets: ends, keyframes, indexed: true };
  } catch (error) {
    if (error instanceof IsvFailure) throw error;
    return null;
  }
}

/** Goes from packet to packet, as far as they are good. @param {Bytes} bytes @param {number} length @param {Parser} parse @returns {Promise<Table>} */
async function walk(bytes, length, parse) {
  const offsets = [];
  const keyframes = [];
  let at = STREAM_HEADER_BYTES;
  while (at + PACKET_HEADER_BYTES <= length && offsets.length < FRAME_LIMIT) {
    const header = parsed(parse, await bytes.read(at, at + PACKET_HEADER_BYTES), at);
    const end = at + PACKET_HEADER_BYTES + (header?.payloadBytes ?? 0);
    if (!header || header.kind === 'index' || end > length) break;
    if (header.kind !== 'unknown') {
      offsets.push(at);
      keyframes.push(header.kind === 'keyframe' ? 1 : 0);
    }
    at = end;
  }
  return { offsets: Float64Array.from([...offsets, at]), keyframes: Uint8Array.from(keyframes), indexed: false };
}

/** @param {Parser} parse @param {Uint8Array} bytes @param {number} at @returns the header, or null if there is none */
function parsed(parse, bytes, at) {
  try {
    return parse.parsePacketHeader(bytes, at);
  } catch (cause) {
    // What a newer version added must not be taken for the end.
    if (!(cause instanceof IsvError) || cause.kind !== 'unsupported') return null;
    throw new IsvFailure('unsupported', `the stream cannot be played: ${cause.message}`, { cause });
  }
}
