// MP4 files as docs/spec/mp4.md has them, made for tests of what reads them: also such that nobody would write.

import { boxAt, made } from '../../src/mp4/boxes.js';
import { packetsOf } from './stream.js';

/** Numbers, big-endian. @param {...number} numbers */
export const u32 = (...numbers) => {
  const bytes = Buffer.alloc(4 * numbers.length);
  numbers.forEach((number, at) => bytes.writeUInt32BE(number >>> 0, 4 * at));
  return bytes;
};
/** @param {...number} numbers */
export const u64 = (...numbers) => {
  const bytes = Buffer.alloc(8 * numbers.length);
  numbers.forEach((number, at) => bytes.writeBigUInt64BE(BigInt(number), 8 * at));
  return bytes;
};
/** @param {string} text */
const text = (text) => Buffer.from(text, 'latin1');
/** @param {number} bytes */
const zeros = (bytes) => Buffer.alloc(bytes);

/** Flags of samples. */
const SYNC = 0x02000000;
const NO_SYNC = 0x01010000;

/**
 * Sound: boxes of its track, and its fragments.
 * @typedef {{ trak: Uint8Array, trex: Uint8Array, fragments: { time: number, moof: Uint8Array, mdat: Uint8Array }[], timescale: number }} Sound
 */

/**
 * @typedef {object} Muxing
 * @property {Sound} [sound] as track 2
 * @property {boolean} [tables] whether the file ends with them
 * @property {number} [timescale]
 * @property {number[]} [starts] times of the frames in its units, and the end of the last; 30 a second if not given
 * @property {Uint8Array} [metadata] packets before the first frame
 * @property {number} [padding] bytes of nothing behind each fragment
 */

/** A stream in MP4. @param {Uint8Array} stream @param {Muxing} [options] @returns {Buffer} */
export function muxed(stream, { sound, tables = true, timescale = 30_000, starts, metadata = zeros(0), padding = 0 } = {}) {
  const packets = packetsOf(stream);
  const at = starts ?? Array.from({ length: packets.length + 1 }, (_, frame) => (frame * timescale) / 30);
  const moov = made('moov', mvhd(), geometryTrak(timescale, Buffer.concat([stream.subarray(0, 48), metadata])), ...(sound ? [sound.trak] : []), made('mvex', trex(1), ...(sound ? [sound.trex] : [])));
  /** @type {Uint8Array[]} */
  const parts = [made('ftyp', text('iso6'), u32(0), text('iso6cmfc')), moov];
  let length = parts[0].length + parts[1].length;
  /** @type {{ track: number, time: number, moof: number }[]} */
  const entries = [];
  /** @type {number[][]} */
  const samples = [];
  const add = (/** @type {number} */ track, /** @type {number} */ time, /** @type {Uint8Array[]} */ boxes) => {
    entries.push({ track, time, moof: length });
    const all = padding ? [...boxes, made('free', zeros(padding))] : boxes;
    parts.push(...all);
    length += all.reduce((bytes, box) => bytes + box.length, 0);
  };
  const waiting = [...(sound?.fragments ?? [])];
  for (let first = 0; first < packets.length; ) {
    let end = first + 1;
    while (end < packets.length && !(packets[end][5] & 1)) end++;
    while (sound && waiting.length && waiting[0].time / sound.timescale <= at[first] / timescale + 1) {
      const { time, moof, mdat } = /** @type {Sound['fragments'][0]} */ (waiting.shift());
      add(2, time, [moof, mdat]);
    }
    const of = packets.slice(first, end);
    const moof = geometryMoof(of, at.slice(first, end + 1), first);
    let place = length + moof.length + 8;
    of.forEach((packet, frame) => {
      samples.push([place, packet.length, packet[5] & 1, at[first + frame + 1] - at[first + frame]]);
      place += packet.length;
    });
    add(1, at[first], [moof, made('mdat', ...of)]);
    first = end;
  }
  for (const { time, moof, mdat } of waiting) add(2, time, [moof, mdat]);
  if (tables) parts.push(ending(entries, samples, at[0]));
  return Buffer.concat(parts);
}

/** The box at the end. @param {{ track: number, time: number, moof: number }[]} entries @param {number[][]} samples offset, bytes, keyframe, duration @param {number} begin */
export function ending(entries, samples, begin) {
  const tracks = [...new Set(entries.map(({ track }) => track))];
  const tfras = tracks.map((track) => {
    const of = entries.filter((entry) => entry.track === track);
    const rows = of.map(({ time, moof }) => Buffer.concat([u64(time, moof), Buffer.from([1, 1, 1])]));
    return made('tfra', u32(0x01000000, track, 0, of.length), ...rows);
  });
  const rows = samples.map(([offset, bytes, keyframe, duration]) => Buffer.concat([u64(2 * offset + keyframe), u32(bytes, duration)]));
  const isvi = made('isvi', u32(0, 1), u64(begin), u32(samples.length), ...rows);
  const size = 8 + tfras.reduce((bytes, box) => bytes + box.length, 0) + isvi.length + 16;
  return made('mfra', ...tfras, isvi, made('mfro', u32(0, size)));
}

/** A fragment of geometry. @param {Uint8Array[]} packets @param {number[]} at times, one more than packets @param {number} [number] @returns {Uint8Array} without its `mdat` */
export function geometryMoof(packets, at, number = 0) {
  const rows = packets.map((packet, frame) => u32(at[frame + 1] - at[frame], packet.length, packet[5] & 1 ? SYNC : NO_SYNC));
  const moof = (/** @type {number} */ offset) =>
    made(
      'moof',
      made('mfhd', u32(0, number)),
      made('traf', made('tfhd', u32(0x020000, 1)), made('tfdt', u32(0x01000000), u64(at[0])), made('trun', u32(0x000701, packets.length, offset), ...rows)),
    );
  return moof(moof(0).length + 8);
}

export function mvhd() {
  return made('mvhd', u32(0, 0, 0, 1000, 0, 0x00010000, 0x01000000, 0, 0), zeros(36 + 24), u32(3));
}

/** @param {number} track */
export function trex(track) {
  return made('trex', u32(0, track, 1, 0, 0, 0));
}

/** @param {number} timescale @param {Uint8Array} config @returns {Uint8Array} */
export function geometryTrak(timescale, config) {
  const entry = made('isv1', zeros(6), Buffer.from([0, 1]), Buffer.concat([Buffer.from([3]), text('isv'), zeros(28)]), made('isvC', config));
  return trak(1, timescale, 'volv', made('vvhd', u32(0)), entry);
}

/** @param {number} id @param {number} timescale @param {string} handler @param {Uint8Array} header @param {Uint8Array} entry @param {...Uint8Array} more boxes */
export function trak(id, timescale, handler, header, entry, ...more) {
  const dref = made('dinf', made('dref', u32(0, 1), made('url ', u32(1))));
  const tables = [made('stts', u32(0, 0)), made('stsc', u32(0, 0)), made('stsz', u32(0, 0, 0)), made('stco', u32(0, 0))];
  const minf = made('minf', header, dref, made('stbl', made('stsd', u32(0, 1), entry), ...tables));
  const hdlr = made('hdlr', u32(0, 0), text(handler), zeros(13));
  const mdia = made('mdia', made('mdhd', u32(0, 0, 0, timescale, 0), Buffer.from([0x55, 0xc4, 0, 0])), hdlr, minf);
  return made('trak', made('tkhd', u32(3, 0, 0, id, 0, 0), zeros(60)), ...more, mdia);
}

/** What no browser plays: sound of a kind, with fragments of a second. @param {number} seconds @param {Uint8Array} [entry] @param {...Uint8Array} more boxes of its track @returns {Sound} */
export function fakeSound(seconds, entry = made('Opus', zeros(28)), ...more) {
  const fragments = Array.from({ length: seconds }, (_, second) => {
    const mdat = made('mdat', Buffer.alloc(100, second));
    const run = made('trun', u32(0x000301, 1, 0, 48_000, 100));
    const traf = made('traf', made('tfhd', u32(0x020000, 2)), made('tfdt', u32(0, second * 48_000)), run);
    return { time: second * 48_000, moof: made('moof', made('mfhd', u32(0, 0)), traf), mdat };
  });
  return { trak: trak(2, 48_000, 'soun', made('smhd', u32(0, 0)), entry, ...more), trex: trex(2), fragments, timescale: 48_000 };
}

/** Sound of a fragmented MP4 file, as track 2. @param {Uint8Array} file @returns {Sound} */
export function soundIn(file) {
  const bytes = new Uint8Array(file);
  /** @type {import('../../src/mp4/boxes.js').Box[]} */
  const boxes = [];
  for (let at = 0; at < bytes.length; at = boxes[boxes.length - 1].end) boxes.push(boxAt(bytes, at));
  const moov = /** @type {import('../../src/mp4/boxes.js').Box} */ (boxes.find(({ type }) => type === 'moov'));
  const found = (/** @type {import('../../src/mp4/boxes.js').Box | undefined} */ box) => /** @type {import('../../src/mp4/boxes.js').Box} */ (box);
  const trak = found(moov.children().find((box) => box.type === 'trak' && box.find('mdia', 'hdlr')?.name(8) === 'soun'));
  const set = (/** @type {import('../../src/mp4/boxes.js').Box} */ box, /** @type {number} */ at) => bytes.set(u32(2), box.body + at);
  const tkhd = found(trak.child('tkhd'));
  const mdhd = found(trak.find('mdia', 'mdhd'));
  const track = tkhd.u32(tkhd.version === 1 ? 20 : 12);
  const trex = found(moov.find('mvex')?.children().find((box) => box.type === 'trex' && box.u32(4) === track));
  set(tkhd, tkhd.version === 1 ? 20 : 12);
  set(trex, 4);
  const fragments = boxes.flatMap((moof, at) => {
    if (moof.type !== 'moof' || found(moof.find('traf', 'tfhd')).u32(4) !== track) return [];
    set(found(moof.find('traf', 'tfhd')), 4);
    const tfdt = found(moof.find('traf', 'tfdt'));
    return [{ time: tfdt.version === 1 ? tfdt.u64(4) : tfdt.u32(4), moof: moof.whole, mdat: boxes[at + 1].whole }];
  });
  return { trak: trak.whole, trex: trex.whole, fragments, timescale: mdhd.u32(mdhd.version === 1 ? 20 : 12) };
}
