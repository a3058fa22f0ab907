// A take in a file: its header, where its frames are, and their packets.

import { IsvFailure } from './failure.js';
import { FrameTimes } from './frame-times.js';
import { Gops } from './gops.js';
import { METADATA_LIMIT, metadataOf } from './metadata.js';
import { IsvError } from './wasm.js';

const STREAM_HEADER_BYTES = 48;
const PACKET_HEADER_BYTES = 24;
const TRAILER_BYTES = 16;
/** Where a packet header states the bytes of its payload. */
const PAYLOAD_LENGTH_AT = 8;
/** Place in it of the time at which the frame is shown. */
const TIMESTAMP_AT = 12;
/** What an MP4 file has behind its first 4 bytes, and what a playlist begins with. */
const FTYP = 'ftyp';
const FTYP_AT = 4;
const PLAYLIST = '#EXTM3U';
/** Largest packet read into memory. */
const PACKET_LIMIT = 1 << 28;
/** Most frames of a file: three days at 60 a second. */
const FRAME_LIMIT = 1 << 24;
/** Largest index read into memory: 8 bytes a frame. */
const INDEX_LIMIT = PACKET_HEADER_BYTES + 8 * FRAME_LIMIT;

/**
 * @typedef {import('./wasm.js').StreamFacts} StreamFacts
 * @typedef {import('./ranges.js').Bytes} Bytes
 * @typedef {import('./metadata.js').Metadata} Metadata
 * @typedef {Pick<import('./wasm.js').Decoder, 'open' | 'parseTrailer' | 'parseIndex' | 'parsePacketHeader'>} Parser
 */

/**
 * A take as players and workers see it.
 * @typedef {object} Source
 * @property {string} name
 * @property {Gops} gops
 * @property {number} frames
 * @property {FrameTimes} times
 * @property {Metadata} metadata what the take says of itself
 * @property {import('./sound/tracks.js').SoundTracks | null} sound null in a take without
 * @property {string} [silence] why the sound that a take has is not there
 * @property {boolean} indexed whether the file says where its frames are; false if its writer did not finish, or its end was lost
 * @property {StreamFacts[]} facts of each stream that frames may come from: one, but in a ladder
 * @property {Uint8Array[]} headers what decoders of these streams are opened with
 * @property {(frame: number) => number} streamOf the stream that a frame's packet comes from
 * @property {(frame: number) => number} offsetOf where a frame's packet begins
 * @property {(from: number, to: number) => number} bytesBetween bytes of the packets of frames `from` to before `to`
 * @property {(frame: number, signal?: AbortSignal) => Promise<Uint8Array>} packet a frame's packet, in a buffer of its own; rejects with a
 *   `LostPart` where frames up to the next keyframe cannot be had, and others can
 * @property {import('./ladder/source.js').Rungs | null} rungs null in what is no ladder
 * @property {(playhead: { seconds: number, speed: number, workers: number }) => void} [attend] hears where the playhead is, how fast it goes, and how
 *   many workers decode
 * @property {(stream: number, frame: number) => boolean} [outdated] whether a frame of a stream would come from a better one now
 * @property {(frame: number) => boolean} [spoil] hears that a frame cannot be decoded, and says whether another stream may have it
 * @property {(frame: import('./worker.js').Frame) => void} [measured] hears of each frame that has been decoded
 * @property {() => void} close
 */

/**
 * Opens a take, told by its content: a stream, an MP4 file, or the playlist of a ladder.
 * @param {Bytes} bytes
 * @param {Parser | Promise<Parser>} parser loaded while both ends of the file are read
 * @returns {Promise<Source>}
 */
export async function openSource(bytes, parser) {
  const length = await bytes.open();
  if (startsWith(await bytes.read(0, Math.min(length, PLAYLIST.length)), PLAYLIST)) {
    const { LadderSource } = await import('./ladder/source.js');
    return LadderSource.open(bytes, length, parser);
  }
  return FileSource.read(bytes, length, parser);
}

/** @implements {Source} */
export class FileSource {
  /** @type {null} */
  rungs = null;
  /** Bytes of all packets before each frame. */
  #before;

  /**
   * @param {Bytes} bytes
   * @param {Uint8Array} header
   * @param {StreamFacts} facts
   * @param {Table} table
   */
  constructor(bytes, header, facts, { offsets, sizes, keyframes, indexed, times, metadata, sound }) {
    this.bytes = bytes;
    this.name = bytes.name;
    /** The 48 bytes that every decoder is opened with. */
    this.headers = [header];
    this.facts = [facts];
    this.gops = new Gops(keyframes);
    this.indexed = indexed;
    this.times = times;
    this.metadata = metadata;
    this.sound = sound;
    this.offsets = offsets;
    this.sizes = sizes;
    this.#before = new Float64Array(sizes.length + 1);
    for (let frame = 0; frame < sizes.length; frame++) this.#before[frame + 1] = this.#before[frame] + sizes[frame];
  }

  /** @param {Bytes} bytes @param {Parser | Promise<Parser>} parser @returns {Promise<FileSource>} */
  static async open(bytes, parser) {
    return FileSource.read(bytes, await bytes.open(), parser);
  }

  /** Reads what a file that is open says of its frames. @param {Bytes} bytes @param {number} length @param {Parser | Promise<Parser>} parser */
  static async read(bytes, length, parser) {
    if (length < STREAM_HEADER_BYTES) throw new IsvFailure('not-isv', `${bytes.name} is no .isv file: it has ${length} bytes`);
    const head = (await bytes.read(0, STREAM_HEADER_BYTES)).slice();
    const mp4 = startsWith(head.subarray(FTYP_AT), FTYP) ? await (await import('./mp4/take.js')).readTake(bytes, length) : null;
    const header = mp4?.header ?? head;
    const parse = await parser;
    const facts = opened(parse, header, bytes.name);
    const table = mp4 ?? (await readStream(bytes, length, parse, facts.fps));
    if (table.keyframes.length === 0) throw new IsvFailure('damaged', `${bytes.name} has no frames`);
    return new FileSource(bytes, header, facts, table);
  }

  get frames() {
    return this.gops.frames;
  }

  streamOf() {
    return 0;
  }

  /** @param {number} frame */
  offsetOf(frame) {
    return this.offsets[frame];
  }

  /** @param {number} from @param {number} to */
  bytesBetween(from, to) {
    return this.#before[Math.min(to, this.frames)] - this.#before[Math.max(0, from)];
  }

  /** @param {number} frame @param {AbortSignal} [signal] */
  async packet(frame, signal) {
    const size = this.sizes[frame];
    if (size > PACKET_LIMIT) throw new IsvFailure('limit', `frame ${frame} has ${size} bytes`);
    const begin = this.offsets[frame];
    const packet = firstPacket(await this.bytes.read(begin, begin + size, signal));
    if (packet.byteLength >= PACKET_HEADER_BYTES) this.times.learn(frame, timestampOf(packet));
    return packet.byteLength === packet.buffer.byteLength ? packet : packet.slice();
  }

  close() {
    this.bytes.close();
  }
}

/** @param {Uint8Array} bytes @param {string} text */
function startsWith(bytes, text) {
  return String.fromCharCode(...bytes.subarray(0, text.length)) === text;
}

/** When a packet's frame is shown, in nanoseconds. @param {Uint8Array} packet */
function timestampOf(packet) {
  return Number(new DataView(packet.buffer, packet.byteOffset).getBigUint64(TIMESTAMP_AT, true));
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
 * Places of frames, and what else a file says.
 * @typedef {object} Table
 * @property {Float64Array} offsets of the packet of each frame
 * @property {Float64Array} sizes bytes up to the next packet of a frame; packets of unknown types may stand between two of them
 * @property {Uint8Array} keyframes 1 at keyframes
 * @property {boolean} indexed
 * @property {FrameTimes} times
 * @property {Metadata} metadata
 * @property {import('./sound/tracks.js').SoundTracks | null} sound
 */

/** @param {Bytes} bytes @param {number} length @param {Parser} parse @param {number} fps @returns {Promise<Table>} */
async function readStream(bytes, length, parse, fps) {
  const { ends, keyframes, indexed } = (await readIndex(bytes, length, parse)) ?? (await walk(bytes, length, parse));
  const frames = keyframes.length;
  const offsets = ends.subarray(0, frames);
  const before = Math.min(offsets[0] ?? 0, STREAM_HEADER_BYTES + METADATA_LIMIT);
  return {
    offsets,
    sizes: offsets.map((at, frame) => ends[frame + 1] - at),
    keyframes,
    indexed,
    times: FrameTimes.nominal(frames, fps),
    metadata: before > STREAM_HEADER_BYTES ? metadataOf(await bytes.read(STREAM_HEADER_BYTES, before)) : {},
    sound: null,
  };
}

/** Beginnings of frames, and the end of the last one. @typedef {{ ends: Float64Array, keyframes: Uint8Array, indexed: boolean }} Places */

/** @param {Bytes} bytes @param {number} length @param {Parser} parse @returns {Promise<Places | null>} null without a good index */
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
    return { ends, keyframes, indexed: true };
  } catch (error) {
    if (error instanceof IsvFailure) throw error;
    return null;
  }
}

/** Goes from packet to packet, as far as they are good. @param {Bytes} bytes @param {number} length @param {Parser} parse @returns {Promise<Places>} */
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
  return { ends: Float64Array.from([...offsets, at]), keyframes: Uint8Array.from(keyframes), indexed: false };
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
