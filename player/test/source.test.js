import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { after, before, test } from 'node:test';
import { BlobBytes, HttpBytes, nameOf } from '../src/ranges.js';
import { FileSource } from '../src/source.js';
import { Decoder } from '../src/wasm.js';
import { serve } from './support/server.js';
import { ending, packetsOf, repeated } from './support/stream.js';

const short = await readFile(new URL('../../conformance/3dof_fine_steps.isv', import.meta.url));
const long = repeated(short, 12_000);
/** @type {import('./support/server.js').Served} */
let server;
/** @type {Decoder} */
let parser;

before(async () => {
  parser = await Decoder.create();
  const files = {
    'short.isv': short,
    'long.isv': long,
    'cut.isv': long.subarray(0, 3_000_001),
    'empty.isv': new Uint8Array(),
    'text.isv': new Uint8Array(5000).fill(65),
  };
  server = await serve(files);
});

after(() => server.close());

/** @param {string} name @param {ConstructorParameters<typeof HttpBytes>[1]} [options] */
const at = (name, options) => new HttpBytes(`${server.url}files/${name}`, options);

/** @param {FileSource} source @param {Uint8Array} stream @param {number[]} frames */
async function samePackets(source, stream, frames) {
  const packets = packetsOf(stream);
  for (const frame of frames)
    assert.deepEqual(Buffer.from(await source.packet(frame)), Buffer.from(packets[frame]), `frame ${frame}`);
}

test('a short file takes two requests, made at once', async () => {
  const bytes = at('short.isv');
  const source = await FileSource.open(bytes, parser);
  await samePackets(source, short, [...packetsOf(short).keys()]);
  assert.equal(bytes.requests, 2);
});

test('packets of unknown types stand between frames, with an index and without', async () => {
  const stream = await readFile(new URL('../../conformance/version_2_skipped.isv', import.meta.url));
  const whole = await FileSource.open(new BlobBytes(new Blob([stream]), 'whole.isv'), parser);
  const cut = await FileSource.open(new BlobBytes(new Blob([stream.subarray(0, -16)]), 'cut.isv'), parser);
  assert.deepEqual([whole.frames, whole.indexed, cut.frames, cut.indexed], [3, true, 3, false]);
  for (const frame of [0, 1, 2]) {
    const packet = Buffer.from(await whole.packet(frame));
    assert.deepEqual([packet[4], packet.length], [1, 24 + packet.readUInt32LE(8)]);
    assert.deepEqual(Buffer.from(await cut.packet(frame)), packet);
  }
});

test('frames of a stream stay as long as their packets say', async () => {
  const irregular = Buffer.from(repeated(short, 9));
  const packets = packetsOf(irregular);
  // Twice as slow as the frame rate says.
  packets.forEach((packet, frame) => Buffer.from(packet.buffer, packet.byteOffset).writeBigUInt64LE(BigInt(Math.round((frame * 2e9) / 30)), 12));
  const source = await FileSource.open(new BlobBytes(new Blob([new Uint8Array(irregular)]), 'irregular.isv'), parser);
  const { times, facts } = source;
  const frameMs = 1000 / facts[0].fps;
  assert.equal(times.frameAt(times.advance(0, (5.5 * frameMs) / 1000)), 5, 'nothing has been read');
  for (let frame = 0; frame < 9; frame++) await source.packet(frame);
  assert.equal(times.frameAt(times.advance(0, 5.5 * (2 / 30))), 5);
  assert.equal(times.frameAt(times.starts[7]), 7, 'a seek needs no times');
});

test('a packet that must be known is no end', async () => {
  const stream = await readFile(new URL('../../conformance/refused/version_2_type_3.isv', import.meta.url));
  const open = FileSource.open(new BlobBytes(new Blob([stream]), 'newer.isv'), parser);
  await assert.rejects(open, { kind: 'unsupported', message: /newer isv/ });
});

test('a long file is read in large parts', async () => {
  const bytes = at('long.isv');
  const source = await FileSource.open(bytes, Promise.resolve(parser));
  assert.equal(source.frames, 12_000);
  assert.ok(bytes.requests <= 4, `${bytes.requests} requests to open it`);
  const frames = Array.from({ length: 3000 }, (_, frame) => frame);
  for (const frame of frames) await source.packet(frame);
  const read = source.bytesBetween(0, 3000);
  assert.ok(bytes.requests < 8 + read / (1 << 20), `${bytes.requests} requests for ${read} bytes`);
  await samePackets(source, long, [0, 1, 2999, 6_000, 11_999]);
  source.close();
});

test('reads at the same time share their requests', async () => {
  const bytes = at('long.isv');
  const source = await FileSource.open(bytes, parser);
  const before = bytes.requests;
  await Promise.all(Array.from({ length: 50 }, (_, frame) => source.packet(6_000 + frame)));
  assert.ok(bytes.requests - before <= 2, `${bytes.requests - before}`);
});

test('a read may be larger than what is kept', async () => {
  const large = new Uint8Array(40 << 20);
  for (let at = 0; at < large.length; at += 4093) large[at] = at % 251;
  server.files.set('large.isv', large);
  const bytes = at('large.isv');
  const length = await bytes.open();
  for (const [from, to] of [[5, length], [1 << 20, 3 << 20], [5, length]])
    assert.equal(Buffer.compare(await bytes.read(from, to), large.subarray(from, to)), 0);
  assert.ok(bytes.requests < 20, `${bytes.requests}`);
  bytes.close();
  server.files.delete('large.isv');
});

test('an index of more bytes than one has is not read', async () => {
  const frames = repeated(short, 30, { indexed: false });
  const end = Buffer.concat(ending(Buffer.alloc(0), 48)).subarray(-16);
  const blob = new Blob([new Uint8Array(frames), new Uint8Array(150 << 20), new Uint8Array(end)]);
  const bytes = new BlobBytes(blob);
  const largest = { read: 0 };
  const read = bytes.read.bind(bytes);
  bytes.read = (from, to) => {
    largest.read = Math.max(largest.read, to - from);
    return read(from, to);
  };
  const source = await FileSource.open(bytes, parser);
  assert.equal(source.frames, 30);
  assert.equal(source.indexed, false);
  assert.ok(largest.read < 1000, `${largest.read}`);
});

test('a request of a server that falls silent is given up, and made again by the next read', async () => {
  const bytes = at('long.isv', { silence: 100 });
  await bytes.open();
  server.habits.silent.add('/files/long.isv');
  const silent = { name: 'IsvFailure', kind: 'missing', message: 'long.isv: the server sends nothing' };
  await assert.rejects(bytes.read(1_000_000, 1_000_100), silent);
  await assert.rejects(bytes.readAlone(9_000_000, 9_000_100), silent);
  await assert.rejects(at('long.isv', { silence: 100 }).open(), silent);
  server.habits.silent.clear();
  assert.equal(Buffer.compare(await bytes.read(1_000_000, 1_000_100), long.subarray(1_000_000, 1_000_100)), 0);
  bytes.close();
});

test('an answer that stops is given up, and one that is slow is not', async () => {
  /** Sends a byte every 40 ms, and none after some. @param {number} bytes */
  const trickling = (bytes) => async (/** @type {any} */ _, /** @type {any} */ { signal }) => {
    let sent = 0;
    const body = new ReadableStream({
      start: (controller) => signal.addEventListener('abort', () => controller.error(signal.reason)),
      pull: async (controller) => {
        await new Promise((wake) => setTimeout(wake, sent < bytes ? 40 : 1000));
        if (signal.aborted) return;
        if (sent < bytes) controller.enqueue(Uint8Array.of(sent++));
        if (sent === 10) controller.close();
      },
    });
    return new Response(body, { status: 200 });
  };
  const open = (/** @type {number} */ bytes) => new HttpBytes('take.isv', { silence: 200, fetch: trickling(bytes) }).open();
  assert.equal(await open(10), 10);
  await assert.rejects(open(5), { kind: 'missing', message: 'take.isv: the server sends nothing' });
});

test('a percent sign in an address may stand for itself', () => {
  assert.equal(nameOf('takes/100%.isv?x'), '100%.isv');
  assert.equal(nameOf('takes/a%20b.isv'), 'a b.isv');
});

test('a server without ranges is read once', async () => {
  server.habits.ranges = false;
  const bytes = at('long.isv');
  const source = await FileSource.open(bytes, parser).finally(() => (server.habits.ranges = true));
  await samePackets(source, long, [0, 11_999]);
  assert.equal(bytes.requests, 2);
});

test('a server without ranges cannot send more than the limit', async () => {
  server.habits.ranges = false;
  const opened = FileSource.open(at('long.isv', { limit: 100_000 }), parser);
  await assert.rejects(opened, { name: 'IsvFailure', kind: 'limit' }).finally(() => (server.habits.ranges = true));
});

test('without an index the packets are walked', async () => {
  const source = await FileSource.open(at('cut.isv'), parser);
  const whole = packetsOf(long).filter((packet) => packet.byteOffset - long.byteOffset + packet.length <= 3_000_001);
  assert.equal(source.indexed, false);
  assert.equal(source.frames, whole.length);
  await samePackets(source, long, [0, whole.length - 1]);
});

test('a file on this device is the same', async () => {
  const source = await FileSource.open(new BlobBytes(new Blob([new Uint8Array(long)])), parser);
  await samePackets(source, long, [0, 1_234, 11_999]);
});

test('what is no stream is said', async () => {
  for (const [name, kind, says] of [
    ['text.isv', 'not-isv', /text\.isv/],
    ['empty.isv', 'not-isv', /empty/],
    ['none.isv', 'missing', /no such file/],
  ]) {
    await assert.rejects(
      FileSource.open(at(String(name)), parser),
      (/** @type {any} */ error) => error.kind === kind && /** @type {RegExp} */ (says).test(error.message),
    );
  }
  const unreachable = new HttpBytes('http://127.0.0.1:9/x.isv');
  await assert.rejects(FileSource.open(unreachable, parser), { kind: 'missing' });
});

test('a file that changes while it plays is noticed', async () => {
  const source = await FileSource.open(at('long.isv'), parser);
  server.files.set('long.isv', repeated(short, 11_000));
  await assert.rejects(source.packet(6_000), /has changed/).finally(() => server.files.set('long.isv', long));
});

test('a read that failed is made again', async () => {
  const source = await FileSource.open(at('long.isv'), parser);
  server.habits.missing.add('/files/long.isv');
  await assert.rejects(source.packet(6_000), { kind: 'missing' }).finally(() => server.habits.missing.clear());
  await samePackets(source, long, [6_000]);
});
