// The decoder against the conformance streams, and against streams that are wrong.
//
// Tests the module beside `wasm.js`. With a path in ISV_WASM_FRESH it tests that one too, and that both do the same: that is how
// `xtask player --check` finds a module that was not built again.

import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { brotliCompressSync, gzipSync } from 'node:zlib';
import { Decoder, IsvError } from '../src/wasm.js';
import { packetsByIndex, packetsByWalking, streamHeader } from './streams.js';

const CONFORMANCE = new URL('../../conformance/', import.meta.url);
const COMMITTED = readFileSync(new URL('../src/isv.wasm', import.meta.url));
const FRESH = process.env.ISV_WASM_FRESH;
const MODULES = [
  { of: 'committed', bytes: COMMITTED },
  ...(FRESH === undefined ? [] : [{ of: 'fresh', bytes: readFileSync(FRESH) }]),
];
const MOST_COMPRESSED_BYTES = 450_000;

const HASHES = readFileSync(new URL('hashes.txt', CONFORMANCE), 'utf8');
const NAMES = readdirSync(CONFORMANCE).filter((name) => name.endsWith('.isv'));

/** @param {string} name */
const read = (name) => new Uint8Array(readFileSync(new URL(name, CONFORMANCE)));

/**
 * The kind of what a call throws.
 * @param {() => unknown} call
 */
function errorOf(call) {
  try {
    call();
  } catch (error) {
    assert.ok(error instanceof IsvError, String(error));
    assert.ok(error.message.length > 10, 'errors have words');
    return error.kind;
  }
  return undefined;
}

/**
 * Hashes of the frames from one on.
 * @param {Decoder} decoder
 * @param {Uint8Array[]} packets
 */
function hashes(decoder, packets) {
  return packets.map((packet) => {
    decoder.decode(packet, { surface: false });
    return decoder.hash();
  });
}

for (const { of, bytes } of MODULES) {
  const create = () => Decoder.create(bytes);

  test(`${of}: it is small`, () => {
    const gzip = gzipSync(bytes, { level: 9 }).length;
    console.log(`${of}: ${bytes.length} bytes, gzip -9 ${gzip}, brotli ${brotliCompressSync(bytes).length}`);
    assert.ok(gzip <= MOST_COMPRESSED_BYTES, `${gzip} bytes compressed`);
  });

  test(`${of}: it needs nothing from outside`, async () => {
    assert.deepEqual(WebAssembly.Module.imports(await WebAssembly.compile(bytes)), []);
  });

  test(`${of}: streams decode to their hashes`, async () => {
    const decoder = await create();
    const lines = HASHES.trimEnd().split('\n');
    const found = [...new Set(lines.map((line) => line.split(' ')[0]))].flatMap((name) => {
      const stream = read(name);
      decoder.open(streamHeader(stream));
      const packets = packetsByWalking(decoder, stream).map(({ bytes }) => bytes);
      return hashes(decoder, packets).map((hash, frame) => `${name} ${frame} ${hash}`);
    });
    assert.deepEqual(found, lines);
  });

  test(`${of}: the header's facts`, async () => {
    const decoder = await create();
    const facts = decoder.open(streamHeader(read('6dof_edge_16.isv')));
    assert.equal(facts.profile, 'paper');
    assert.equal(facts.blockSide, 16);
    assert.equal(decoder.open(streamHeader(read('main_inter.isv'))).profile, 'main');
    assert.ok(facts.voxelSize > 1e-4 && facts.voxelSize < 1 && facts.fps > 0 && facts.truncation >= 2);
  });

  test(`${of}: index and walking agree`, async () => {
    const decoder = await create();
    for (const name of NAMES) {
      const stream = read(name);
      decoder.open(streamHeader(stream));
      const walked = packetsByWalking(decoder, stream);
      if (!name.includes('no_index')) assert.deepEqual(packetsByIndex(decoder, stream), walked, name);
      assert.ok(walked.length === 0 || walked[0].keyframe, name);
    }
  });

  test(`${of}: a stream can be entered behind its keyframe where it is refreshed`, async () => {
    const decoder = await create();
    const stream = read('main_resilient.isv');
    decoder.open(streamHeader(stream));
    const packets = packetsByWalking(decoder, stream).map(({ bytes }) => bytes);
    const all = hashes(decoder, packets);
    const late = await create();
    late.open(streamHeader(stream));
    const inexact = packets.slice(1).map((packet) => late.decode(packet).inexactBlocks);
    // All is refreshed in three frames.
    assert.ok(inexact[0] > inexact[1] && inexact[1] > 0, inexact.join());
    assert.deepEqual(inexact.slice(2), [0, 0]);
    assert.equal(late.hash(), all[4]);
  });

  test(`${of}: a surface is a mesh`, async () => {
    const decoder = await create();
    const stream = read('main_inter.isv');
    decoder.open(streamHeader(stream));
    const [{ bytes: packet }] = packetsByWalking(decoder, stream);
    const { positions, normals, indices } = decoder.decode(packet, { normals: true });
    assert.ok(positions.length > 0 && indices.length > 0);
    assert.equal(normals.length, positions.length);
    assert.ok(indices.every((index) => index < positions.length / 3));
    assert.ok(positions.every((x) => Math.abs(x) < 100));
    for (let n = 0; n < normals.length; n += 3) {
      assert.ok(Math.abs(Math.hypot(normals[n], normals[n + 1], normals[n + 2]) - 1) < 1e-4);
    }
    const plain = decoder.decode(packet);
    assert.deepEqual([plain.positions, plain.normals.length], [positions, 0]);
    assert.equal(decoder.decode(packet, { surface: false }).positions.length, 0);
  });

  test(`${of}: blocks are told of where that is wanted`, async () => {
    const decoder = await create();
    for (const name of NAMES) {
      const stream = read(name);
      const { voxelSize, blockSide } = decoder.open(streamHeader(stream));
      for (const [frame, { bytes }] of packetsByWalking(decoder, stream).entries()) {
        const { blocks } = decoder.decode(bytes, { surface: false, details: true });
        assert.ok(blocks !== undefined);
        const { places, bits, motion } = blocks;
        assert.equal(places.length, 4 * bits.length, name);
        assert.equal(motion.length, 3 * bits.length, name);
        assert.ok(bits.reduce((sum, count) => sum + count, 0) <= 8 * bytes.length, name);
        assert.ok(motion.every((metres) => Math.abs(metres) <= 4 * blockSide * voxelSize), name);
        const codings = bits.map((_, block) => places[4 * block + 3]);
        assert.ok(codings.every((coding) => [0, 1, 2].includes(coding)), name);
        assert.ok(frame > 0 || codings.every((coding) => coding === 1), name);
        assert.ok(bits.every((count, block) => count >= 0 && (codings[block] > 0 || count === 0)), name);
      }
    }
    decoder.open(streamHeader(read('intra.isv')));
    const [{ bytes }] = packetsByWalking(decoder, read('intra.isv'));
    assert.equal(decoder.decode(bytes).blocks, undefined);
  });

  test(`${of}: decoding from a keyframe gives the frames from the start`, async () => {
    const decoder = await create();
    let tested = 0;
    for (const name of NAMES) {
      const stream = read(name);
      decoder.open(streamHeader(stream));
      const packets = packetsByWalking(decoder, stream);
      const all = hashes(
        decoder,
        packets.map(({ bytes }) => bytes),
      );
      for (const [frame, { keyframe }] of packets.entries()) {
        if (frame > 0 && keyframe) {
          decoder.open(streamHeader(stream));
          assert.deepEqual(
            hashes(
              decoder,
              packets.slice(frame).map(({ bytes }) => bytes),
            ),
            all.slice(frame),
          );
          tested += 1;
        }
      }
    }
    assert.ok(tested > 0, 'a stream has a second keyframe');
  });

  test(`${of}: a damaged frame is an error, and the next keyframe is decoded`, async () => {
    const decoder = await create();
    for (const name of ['3dof.isv', 'main_inter.isv']) {
      const stream = read(name);
      decoder.open(streamHeader(stream));
      const packets = packetsByWalking(decoder, stream).map(({ bytes }) => bytes);
      const all = hashes(decoder, packets);
      decoder.open(streamHeader(stream));
      assert.equal(
        errorOf(() => decoder.decode(packets[1])),
        'keyframe',
      );
      decoder.decode(packets[0]);
      const damaged = packets[1].slice();
      damaged[damaged.length >> 1] ^= 4;
      assert.equal(
        errorOf(() => decoder.decode(damaged)),
        'malformed',
      );
      assert.equal(
        errorOf(() => decoder.decode(packets[2])),
        'keyframe',
      );
      assert.equal(
        errorOf(() => decoder.decode(packets[1])),
        'keyframe',
      );
      assert.deepEqual(hashes(decoder, packets), all);
    }
  });

  test(`${of}: a cut packet is an error, wherever it is cut`, async () => {
    const decoder = await create();
    const stream = read('main_inter.isv');
    decoder.open(streamHeader(stream));
    const [{ bytes }] = packetsByWalking(decoder, stream);
    for (let length = 0; length < bytes.length; length += 1 + (length >> 3)) {
      assert.equal(
        errorOf(() => decoder.decode(bytes.subarray(0, length))),
        'malformed',
        `${length} bytes`,
      );
    }
    assert.equal(
      errorOf(() => decoder.decode(Uint8Array.of(...bytes, 0))),
      'malformed',
    );
    decoder.decode(bytes);
  });

  test(`${of}: other bytes are errors`, async () => {
    const decoder = await create();
    const zeros = new Uint8Array(48);
    assert.equal(
      errorOf(() => decoder.open(zeros)),
      'malformed',
    );
    assert.equal(
      errorOf(() => decoder.open(zeros.subarray(1))),
      'malformed',
    );
    assert.equal(decoder.parseTrailer(zeros.subarray(32)), undefined);
    const stream = read('intra.isv');
    decoder.open(streamHeader(stream));
    assert.equal(
      errorOf(() => decoder.parsePacketHeader(zeros.subarray(24), 48)),
      'malformed',
    );
    assert.equal(
      errorOf(() => decoder.parseIndex(zeros, 48)),
      'malformed',
    );
    const [first] = packetsByWalking(decoder, stream);
    assert.equal(
      errorOf(() => decoder.decode(zeros)),
      'malformed',
    );
    assert.equal(
      errorOf(() => decoder.parseIndex(first.bytes, first.at)),
      'malformed',
    );
  });

  test(`${of}: what only a newer decoder knows is told from damage`, async () => {
    const decoder = await create();
    const [version, needed] = ['version_3.isv', 'version_2_type_3.isv'].map((name) => read(`refused/${name}`));
    assert.equal(
      errorOf(() => decoder.open(streamHeader(version))),
      'unsupported',
    );
    decoder.open(streamHeader(needed));
    assert.equal(
      errorOf(() => packetsByWalking(decoder, needed)),
      'unsupported',
    );
  });

  test(`${of}: calls in the wrong order and above the limits are errors`, async () => {
    const decoder = await create();
    const stream = read('intra.isv');
    const other = await create();
    other.open(streamHeader(stream));
    const [{ bytes }] = packetsByWalking(other, stream);
    assert.equal(
      errorOf(() => decoder.decode(bytes)),
      'order',
    );
    assert.equal(
      errorOf(() => decoder.parsePacketHeader(bytes.subarray(0, 24), 48)),
      'order',
    );
    decoder.limit(512);
    decoder.open(streamHeader(stream));
    assert.equal(
      errorOf(() => decoder.decode(bytes)),
      'limit',
    );
    assert.equal(
      errorOf(() => decoder.decode(new Uint8Array(17 << 20))),
      'limit',
    );
    const huge = bytes.slice(0, 24);
    new DataView(huge.buffer).setUint32(8, 0xffff_ffff, true);
    assert.equal(
      errorOf(() => decoder.parsePacketHeader(huge, 48)),
      'limit',
    );
    decoder.limit(1 << 26);
    decoder.open(streamHeader(stream));
    decoder.decode(bytes);
  });

  test(`${of}: memory does not grow from frame to frame`, async () => {
    const decoder = await create();
    const stream = read('main_inter.isv');
    decoder.open(streamHeader(stream));
    const packets = packetsByWalking(decoder, stream);
    const decode = () => packets.forEach(({ bytes }) => decoder.decode(bytes, { normals: true }));
    for (let warm = 0; warm < 3; warm += 1) {
      decode();
    }
    const before = decoder.memoryBytes;
    for (let decoded = 0; decoded < 300; decoded += packets.length) {
      decode();
    }
    assert.equal(decoder.memoryBytes, before);
  });
}

/** A frame without how long it took. @param {import('../src/wasm.js').DecodedFrame} frame */
function untimed({ decodeMs, surfaceMs, ...frame }) {
  assert.ok(decodeMs >= 0 && surfaceMs >= 0);
  return frame;
}

test('the committed module does what a fresh one does', { skip: FRESH === undefined }, async () => {
  const [committed, fresh] = await Promise.all(MODULES.map(({ bytes }) => WebAssembly.compile(bytes)));
  assert.deepEqual(WebAssembly.Module.exports(committed), WebAssembly.Module.exports(fresh));
  const decoders = await Promise.all([committed, fresh].map((module) => Decoder.create(module)));
  for (const name of NAMES) {
    const stream = read(name);
    const [ours, theirs] = decoders.map((decoder) => {
      const facts = decoder.open(streamHeader(stream));
      const packets = packetsByWalking(decoder, stream);
      const frames = packets.map(({ bytes }) => untimed(decoder.decode(bytes, { normals: true, details: true })));
      return { facts, frames };
    });
    assert.deepEqual(ours, theirs, name);
  }
});
