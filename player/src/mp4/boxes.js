// Boxes of MP4 (ISO/IEC 14496-12), read and written. All lengths come from outside: none is followed beyond what is there.

import { IsvFailure } from '../failure.js';

/** Most boxes in one box: a movie has a few tracks. */
const CHILD_LIMIT = 4096;

/** Bytes of a box's size and type, and of the size of a large one. */
export const BOX_HEADER_BYTES = 8;
export const LARGE_HEADER_BYTES = 16;

/** A box in memory. */
export class Box {
  #view;

  /**
   * @param {Uint8Array} bytes that it lies in
   * @param {string} type
   * @param {number} start
   * @param {number} body where its contents begin
   * @param {number} end
   */
  constructor(bytes, type, start, body, end) {
    this.bytes = bytes;
    this.type = type;
    this.start = start;
    this.body = body;
    this.end = end;
    this.#view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  /** Bytes of the contents. */
  get length() {
    return this.end - this.body;
  }

  /** The box as bytes, its header included. */
  get whole() {
    return this.bytes.subarray(this.start, this.end);
  }

  /** @param {number} at from the first byte of the contents */
  u8(at) {
    return this.#view.getUint8(this.#place(at, 1));
  }

  /** @param {number} at */
  u16(at) {
    return this.#view.getUint16(this.#place(at, 2));
  }

  /** @param {number} at */
  u32(at) {
    return this.#view.getUint32(this.#place(at, 4));
  }

  /** A number of 64 bits; those above 2^53 are rounded. @param {number} at */
  u64(at) {
    return Number(this.#view.getBigUint64(this.#place(at, 8)));
  }

  /** A signed number of 64 bits. @param {number} at */
  i64(at) {
    return Number(this.#view.getBigInt64(this.#place(at, 8)));
  }

  /** @param {number} at */
  i32(at) {
    return this.#view.getInt32(this.#place(at, 4));
  }

  /** Four characters. @param {number} at */
  name(at) {
    return nameAt(this.bytes, this.#place(at, 4));
  }

  /** Version and flags of a full box. */
  get version() {
    return this.u8(0);
  }

  get flags() {
    return this.u32(0) & 0xffffff;
  }

  /** Boxes inside. @param {number} [skip] bytes of the contents before the first @returns {Box[]} */
  children(skip = 0) {
    const boxes = [];
    for (let at = this.body + skip; at + BOX_HEADER_BYTES <= this.end; at = boxes[boxes.length - 1].end) {
      if (boxes.length === CHILD_LIMIT) throw broken(`a box ${this.type} has too many boxes`);
      boxes.push(boxAt(this.bytes, at, this.end));
    }
    return boxes;
  }

  /** The first box of a type inside. @param {string} type @param {number} [skip] */
  child(type, skip = 0) {
    return this.children(skip).find((box) => box.type === type);
  }

  /** A box deeper inside. @param {...string} types one a level @returns {Box | undefined} */
  find(...types) {
    /** @type {Box | undefined} */
    let box = this;
    for (const type of types) box = box?.child(type);
    return box;
  }

  /** @param {number} at @param {number} length */
  #place(at, length) {
    const place = this.body + at;
    if (at < 0 || place + length > this.end) throw broken(`a box ${this.type} is too short`);
    return place;
  }
}

/** The box that begins at a place. @param {Uint8Array} bytes @param {number} at @param {number} [limit] where it ends at the latest */
export function boxAt(bytes, at, limit = bytes.length) {
  const { type, header, size } = headerAt(bytes.subarray(at, limit), limit - at);
  if (size > limit - at) throw broken(`a box ${type} is longer than what it lies in`);
  return new Box(bytes, type, at, at + header, at + size);
}

/**
 * What a box's first bytes say.
 * @param {Uint8Array} bytes at least 8, 16 where there are so many
 * @param {number} rest bytes from the box's first on
 * @returns {{ type: string, header: number, size: number }} size: may be more than the rest
 */
export function headerAt(bytes, rest) {
  if (bytes.length < BOX_HEADER_BYTES) throw broken('a box ends early');
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const type = nameAt(bytes, 4);
  const small = view.getUint32(0);
  if (small === 1 && bytes.length < LARGE_HEADER_BYTES) throw broken(`a box ${type} ends early`);
  const header = small === 1 ? LARGE_HEADER_BYTES : BOX_HEADER_BYTES;
  const size = small === 0 ? rest : small === 1 ? Number(view.getBigUint64(8)) : small;
  if (size < header) throw broken(`a box ${type} is shorter than its header`);
  return { type, header, size };
}

/** A box made of parts. @param {string} type @param {...Uint8Array} parts */
export function made(type, ...parts) {
  const size = parts.reduce((bytes, part) => bytes + part.length, BOX_HEADER_BYTES);
  const box = new Uint8Array(size);
  new DataView(box.buffer).setUint32(0, size);
  for (let at = 0; at < 4; at++) box[4 + at] = type.charCodeAt(at);
  let at = BOX_HEADER_BYTES;
  for (const part of parts) {
    box.set(part, at);
    at += part.length;
  }
  return box;
}

/** What the `mdat` of a fragment holds. @param {Uint8Array} fragment */
export function payloadOf(fragment) {
  const mdat = new Box(fragment, 'fragment', 0, 0, fragment.length).child('mdat');
  if (!mdat) throw broken('a fragment has no samples');
  return fragment.subarray(mdat.body, mdat.end);
}

/** @param {string} what */
export function broken(what) {
  return new IsvFailure('damaged', `the MP4 file is damaged: ${what}`);
}

/** @param {Uint8Array} bytes @param {number} at */
function nameAt(bytes, at) {
  return String.fromCharCode(...bytes.subarray(at, at + 4));
}
