import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { after, before, test } from 'node:test';
import { boxAt, made } from '../src/mp4/boxes.js';
import { codecOf, readMovie } from '../src/mp4/movie.js';
import { BlobBytes, HttpBytes } from '../src/ranges.js';
import { FileSource } from '../src/source.js';
import { Decoder } from '../src/wasm.js';
import { fakeSound, geometryTrak, muxed, mvhd, trak, u32, u64 } from './support/mp4.js';
import { serve } from './support/server.js';
import { metadataPacket, packetsOf, repeated } from './support/stream.js';

const short = await readFile(new URL('../../conformance/main_settled.isv', import.meta.url));
/** Three seconds of GOPs of 4 frames. */
const GOP = 4;
const stream = repeated(short, 90, { gop: GOP });
const packets = packetsOf(stream);
const sound = fakeSound(3);
const take = muxed(stream, { sound });
/** @type {Decoder} */
let parser;
/** @type {import('./support/server.js').Served} */
let server;

before(async () => {
  parser = await Decoder.create();
  server = await serve({ 'take.mp4': take });
});

after(() => server.close());

/** @param {Uint8Array} bytes */
const open = (bytes) => FileSource.open(new BlobBytes(new Blob([new Uint8Array(bytes)]), 'take.mp4'), parser);

/** @param {FileSource} source @param {number} [frames] */
async function isTheStream(source, frames = packets.length) {
  assert.equal(source.frames, frames);
  for (let frame = 0; frame < frames; frame++)
    assert.deepEqual(Buffer.from(await source.packet(frame)), Buffer.from(packets[frame]), `frame ${frame}`);
  assert.deepEqual([...source.gops.keyframes], [...packets.keys()].slice(0, frames).filter((frame) => frame % GOP === 0));
}

/** Place of a box. @param {Uint8Array} bytes @param {string} type @param {number} [nth] */
function find(bytes, type, nth = 0) {
  let at = -1;
  for (let found = 0; found <= nth; found++) at = Buffer.from(bytes).indexOf(type, at + 1, 'latin1');
  assert.ok(at > 0, `there is no ${type}`);
  return at - 4;
}

/** A copy with some bytes replaced. @param {Uint8Array} bytes @param {number} at @param {Uint8Array} by */
function patched(bytes, at, by) {
  const copy = Buffer.from(bytes);
  copy.set(by, at);
  return copy;
}

test('the frames of a file are those of the stream, from its table and from its fragments', async () => {
  const tabled = await open(take);
  const walked = await open(muxed(stream, { sound, tables: false }));
  await isTheStream(tabled);
  await isTheStream(walked);
  assert.deepEqual([tabled.indexed, walked.indexed], [true, false]);
  for (const { times } of [tabled, walked]) {
    assert.ok(Math.abs(times.duration - 3) < 1e-9);
    assert.equal(times.frameAt(1.01), 30);
  }
  assert.deepEqual(Buffer.from(tabled.headers[0]), Buffer.from(stream.subarray(0, 48)));
});

test('the frame table takes one request: both ends of the file, and no more', async () => {
  const bytes = new HttpBytes(`${server.url}files/take.mp4`);
  await FileSource.open(bytes, parser);
  assert.equal(bytes.requests, 2);
});

test('sound is taken fragment by fragment, as it lies there', async () => {
  for (const tables of [true, false]) {
    const { sound: tracks } = await open(muxed(stream, { sound, tables }));
    assert.ok(tracks);
    assert.deepEqual([tracks.length, tracks[0].codec, [...tracks[0].starts]], [1, 'opus', [0, 1, 2]]);
    const signal = new AbortController().signal;
    for (const at of [2, 0, 1]) {
      const { moof, mdat } = sound.fragments[at];
      assert.deepEqual(Buffer.from(await tracks[0].fragment(at, signal)), Buffer.concat([moof, mdat]));
    }
    const init = await tracks[0].init();
    const moov = boxAt(init, boxAt(init, 0).end);
    assert.equal(moov.end, init.length);
    assert.deepEqual(moov.children().map(({ type }) => type), ['mvhd', 'trak', 'mvex']);
    assert.deepEqual(Buffer.from(moov.children()[1].whole), Buffer.from(sound.trak));
    assert.equal(moov.find('mvex', 'trex')?.u32(4), 2);
  }
});

test('only bytes of sound are fetched for it', async () => {
  const bytes = new HttpBytes(`${server.url}files/take.mp4`);
  const length = await bytes.open();
  server.files.set('long.mp4', Buffer.concat([take, new Uint8Array(1 << 22)]));
  const long = new HttpBytes(`${server.url}files/long.mp4`);
  await long.open();
  server.requests.length = 0;
  await long.readAlone(2_000_000, 2_000_100);
  await long.readAlone(100, 200);
  assert.deepEqual(server.requests.map(({ range }) => range), ['bytes=2000000-2000099'], 'what is there is not fetched again');
  assert.deepEqual(Buffer.from(await long.readAlone(0, length)), take);
});

test('times are those of the packets, however irregular, counted from the first frame', async () => {
  const starts = Array.from({ length: 91 }, (_, frame) => 90_000 + frame * 400 + (frame > 50 ? 20_000 : 0));
  for (const tables of [true, false]) {
    const { times, sound: tracks } = await open(muxed(stream, { starts, timescale: 10_000, sound, tables }));
    assert.equal(times.starts[0], 0);
    assert.ok(Math.abs(times.starts[50] - 2) < 1e-9);
    assert.ok(Math.abs(times.starts[51] - 4.04) < 1e-9);
    assert.equal(times.frameAt(3), 50);
    assert.equal(tracks?.[0].starts[0], -9, 'sound begins before it');
    assert.equal(tracks?.[0].begin, 9);
  }
});

test('an edit list moves sound', async () => {
  const edit = (/** @type {number[][]} */ ...edits) =>
    made('edts', made('elst', u32(0, edits.length), ...edits.map(([duration, media]) => u32(duration, media, 0x10000))));
  for (const [edts, start] of /** @type {[Uint8Array, number][]} */ ([
    [edit([0, 480]), -0.01],
    [edit([500, -1], [0, 480]), 0.49],
    [edit(), 0],
  ])) {
    const { sound: tracks } = await open(muxed(stream, { sound: fakeSound(3, undefined, edts) }));
    assert.ok(Math.abs((tracks?.[0].starts[0] ?? NaN) - start) < 1e-9);
  }
});

test('codecs are called what browsers call them', () => {
  const esds = (/** @type {number} */ kind, /** @type {number[]} */ specific) => {
    const bytes = [0, 0, 0, 0, 3, 0x80, 0x80, 25, 0, 2, 0, 4, 17, kind, ...new Array(12).fill(0), 5, specific.length, ...specific];
    return made('mp4a', new Uint8Array(28), made('esds', Uint8Array.from(bytes)));
  };
  for (const [entry, codec] of /** @type {[Uint8Array, string][]} */ ([
    [esds(0x40, [0x12, 0x10]), 'mp4a.40.2'],
    [esds(0x40, [0xf8, 0xe0]), 'mp4a.40.39'],
    [esds(0x6b, []), 'mp4a.6B'],
    [made('mp4a', new Uint8Array(28)), 'mp4a'],
    [made('fLaC', new Uint8Array(28)), 'flac'],
    [made('ipcm', new Uint8Array(28)), 'ipcm'],
    [made('ac-3', new Uint8Array(28)), 'ac-3'],
  ])) {
    const moov = boxAt(made('moov', mvhd(), geometryTrak(1000, stream.subarray(0, 48)), trak(2, 1000, 'soun', made('smhd'), entry)), 0);
    assert.equal(codecOf(readMovie(moov, new Uint8Array(), 'x').sounds[0]), codec);
  }
});

test('metadata stands behind the stream header', async () => {
  const metadata = metadataPacket({ title: 'Clap', up: 'z' });
  assert.deepEqual((await open(muxed(stream, { metadata }))).metadata, { title: 'Clap', up: 'z' });
});

test('a file that ends early plays up to its end', async () => {
  const whole = muxed(stream, { sound, tables: false });
  const moof = find(whole, 'moof', 12);
  for (const length of [moof, moof + 3, moof + 40]) {
    const source = await open(whole.subarray(0, length));
    assert.ok(source.frames % GOP === 0 && source.frames > 20 && source.frames < 60, `${source.frames} frames of ${length} bytes`);
    await isTheStream(source, source.frames);
  }
  // In the middle of a GOP's packets.
  const source = await open(whole.subarray(0, whole.length - packets[89].length - 5));
  await isTheStream(source, 88);
  const { sound: tracks } = await open(whole.subarray(0, whole.indexOf(sound.fragments[2].mdat) + 20));
  assert.deepEqual([...(tracks?.[0].starts ?? [])], [0, 1], 'a fragment that is cut is not taken');
});

test('boxes that nobody knows are passed over', async () => {
  const strange = made('what', new Uint8Array(1000));
  const moov = find(take, 'moov');
  await isTheStream(await open(Buffer.concat([take.subarray(0, moov), strange, muxed(stream, { tables: false }).subarray(moov), strange])));
});

test('a table that lies is not believed: the fragments say the same', async () => {
  const isvi = find(take, 'isvi');
  const mfro = find(take, 'mfro');
  const tfra = find(take, 'tfra');
  for (const [why, bytes] of /** @type {[string, Uint8Array][]} */ ([
    ['another track', patched(take, isvi + 12, u32(2))],
    ['more samples than there are', patched(take, isvi + 24, u32(91))],
    ['far more', patched(take, isvi + 24, u32(0xffffffff))],
    ['a frame behind the end', patched(take, isvi + 28, u64(2 * take.length))],
    ['a frame of no bytes', patched(take, isvi + 36, u32(0))],
    ['a frame of too many', patched(take, isvi + 36, u32(0xffffffff))],
    ['an offset of 2^63', patched(take, isvi + 28, Buffer.alloc(8, 0xff))],
    ['a table that begins before the file', patched(take, mfro + 12, u32(take.length + 1))],
    ['a table that begins in a frame', patched(take, mfro + 12, u32(900))],
    ['a table that begins at itself', patched(take, mfro + 12, u32(16))],
    ['a table of no bytes', patched(take, mfro + 12, u32(0))],
    ['more fragments than there are', patched(take, tfra + 20, u32(0x7fffffff))],
    ['a box longer than the table', patched(take, isvi, u32(0x7fffffff))],
    ['a box shorter than its header', patched(take, isvi, u32(4))],
  ])) {
    const source = await open(bytes);
    assert.equal(source.indexed, false, why);
    assert.equal(source.frames, 90, why);
  }
});

test('what is damaged is one clear failure', async () => {
  const moov = find(take, 'moov');
  const whole = muxed(stream, { tables: false });
  const first = find(whole, 'moof');
  const zero = made('mdhd', u32(0, 0, 0, 0, 0));
  const large = Buffer.concat([u32(1), Buffer.from('moov'), Buffer.alloc(8, 0xff)]);
  for (const [why, bytes, kind] of /** @type {[string, Uint8Array, string][]} */ ([
    ['no tracks', Buffer.concat([take.subarray(0, moov), made('free', new Uint8Array(100))]), 'damaged'],
    ['a movie box that is cut', take.subarray(0, moov + 200), 'damaged'],
    ['a movie box of 2^64 bytes', Buffer.concat([take.subarray(0, moov), large, new Uint8Array(100)]), 'damaged'],
    ['a box of no bytes', Buffer.concat([take.subarray(0, moov), u32(0, 0), take.subarray(moov)]), 'damaged'],
    ['a box of 3 bytes', Buffer.concat([take.subarray(0, moov), u32(3, 0), take.subarray(moov)]), 'damaged'],
    ['no geometry', patched(take, find(take, 'isv1') + 4, Buffer.from('avc1')), 'not-isv'],
    ['no stream header', patched(take, find(take, 'isvC') + 4, Buffer.from('what')), 'damaged'],
    ['a header of another stream', patched(take, find(take, 'isvC') + 8, Buffer.from('notisv!!')), 'not-isv'],
    ['no timescale', patched(take, find(take, 'mdhd'), zero), 'damaged'],
    ['a track in a track that is longer than it', patched(take, find(take, 'mdia'), u32(0x00ffffff)), 'damaged'],
    ['no fragments', whole.subarray(0, first), 'damaged'],
    ['a run that counts more samples than it has', patched(whole, find(whole, 'trun') + 12, u32(0x7fffffff)), 'damaged'],
    ['a sample of no bytes', patched(whole, find(whole, 'trun') + 24, u32(0)), 'damaged'],
    ['samples before the file', patched(whole, find(whole, 'trun') + 16, u32(0x80000000)), 'damaged'],
    ['a fragment of no track', patched(whole, find(whole, 'tfhd') + 4, Buffer.from('what')), 'damaged'],
  ])) {
    await assert.rejects(open(bytes), (/** @type {any} */ error) => {
      assert.equal(error.name, 'IsvFailure', `${why}: ${error.stack}`);
      assert.equal(error.kind, kind, `${why}: ${error.message}`);
      return true;
    });
  }
});

test('a run that counts samples without listing them ends with the file', async () => {
  // All samples are as large as the first; nothing is said of each.
  const run = made('trun', u32(0x000001, 0xffffffff, 0));
  const traf = made('traf', made('tfhd', u32(0x020018, 1, 1000, 24)), made('tfdt', u32(0, 0)), run);
  const head = muxed(stream, { tables: false });
  const bytes = Buffer.concat([head.subarray(0, find(head, 'moof')), made('moof', made('mfhd', u32(0, 0)), traf), made('mdat', new Uint8Array(240))]);
  const source = await open(bytes);
  assert.ok(source.frames < bytes.length / 24);
});

test('any bytes changed and any cut is a take or a failure, never anything else', async () => {
  const small = muxed(repeated(short, 6, { gop: 3 }), { sound: fakeSound(1) });
  let seed = 1;
  const random = (/** @type {number} */ below) => {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    return seed % below;
  };
  const structure = [...Array(find(small, 'moof')).keys(), ...Array.from({ length: 600 }, (_, at) => find(small, 'moof') + at), ...Array.from({ length: small.length - find(small, 'mfra') }, (_, at) => find(small, 'mfra') + at)];
  for (let round = 0; round < 1500; round++) {
    const bytes = Buffer.from(round % 5 ? small : small.subarray(0, random(small.length)));
    for (let change = 0; change <= random(3); change++) {
      const at = structure[random(structure.length)];
      if (at < bytes.length) bytes[at] = [0, 1, 0x7f, 0x80, 0xff, random(256)][random(6)];
    }
    try {
      const source = await open(bytes);
      for (const track of source.sound ?? []) {
        await track.init();
        for (let at = 0; at < Math.min(3, track.starts.length); at++) await track.fragment(at, new AbortController().signal);
      }
      await source.packet(0);
    } catch (error) {
      assert.equal(/** @type {Error} */ (error).name, 'IsvFailure', `round ${round}: ${/** @type {Error} */ (error).stack}`);
    }
  }
});
