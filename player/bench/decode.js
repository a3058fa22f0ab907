// How long frames take to decode and their surfaces to extract, one thread, best of several runs:
//
//   node player/bench/decode.js STREAM.isv [ISV]
//   node player/bench/decode.js STREAM.isv --parts
//
// ISV: the command's path, for the ratio to native code on one thread. --parts: of a large scene in one GOP, each frame after the
// keyframe with its surface as a whole and in parts, in one run, with the copies of the arrays.

import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { Decoder } from '../src/wasm.js';
import { packetsByWalking, streamHeader } from '../test/streams.js';

const RUNS = 10;

/**
 * Mean of the frames' best times.
 * @param {number[][]} runs Milliseconds of each frame, run by run.
 */
function meanOfBest(runs) {
  const best = runs[0].map((_, frame) => Math.min(...runs.map((times) => times[frame])));
  return best.reduce((sum, time) => sum + time, 0) / best.length;
}

/**
 * Times of each frame in WebAssembly.
 * @param {Decoder} decoder
 * @param {Uint8Array[]} packets
 * @param {import('../src/wasm.js').DecodeOptions} options
 */
function run(decoder, packets, options) {
  return packets.map((packet) => {
    const begin = performance.now();
    decoder.decode(packet, options);
    return performance.now() - begin;
  });
}

/**
 * Times of each frame in native code.
 * @param {string} isv
 * @param {string} file
 * @returns {{ decode: number[], surface: number[] }}
 */
function runNative(isv, file) {
  const folder = mkdtempSync(join(tmpdir(), 'isv-bench-'));
  try {
    const stats = join(folder, 'stats.json');
    const output = ['-o', join(folder, 'frames'), '--stats', stats];
    execFileSync(isv, ['decode', file, '--threads', '1', '--backend', 'cpu', '--normals', ...output], { stdio: 'ignore' });
    /** @type {{ frames: { decode_ms: number, surface_ms: number }[] }} */
    const { frames } = JSON.parse(readFileSync(stats, 'utf8'));
    return { decode: frames.map((frame) => frame.decode_ms), surface: frames.map((frame) => frame.surface_ms) };
  } finally {
    rmSync(folder, { recursive: true });
  }
}

/** Surfaces of frames after the keyframe: whole, and the parts that changed. */
function compareParts() {
  const header = streamHeader(stream);
  for (const [what, parts] of /** @type {[string, number][]} */ ([['whole surfaces', Infinity], ['parts', 0]])) {
    decoder.limit(2 ** 31, { trusted: true });
    decoder.open(header);
    const times = packets.map((packet) => {
      const begin = performance.now();
      const { decodeMs, surfaceMs, indices } = decoder.decode(packet, { normals: true, parts });
      return { decodeMs, surfaceMs, all: performance.now() - begin, triangles: indices.length / 3 };
    });
    const later = times.slice(1);
    const median = (/** @type {'decodeMs' | 'surfaceMs' | 'all' | 'triangles'} */ of) =>
      later.map((frame) => frame[of]).sort((a, b) => a - b)[later.length >> 1];
    const [decode, surface, all] = [median('decodeMs'), median('surfaceMs'), median('all')].map(Math.round);
    const keyframe = Math.round(times[0].all);
    const memory = Math.round(decoder.memoryBytes / 1e6);
    console.log(
      `${what}: decode ${decode} ms, surface ${surface} ms, with copies ${all} ms, ${median('triangles')} triangles; ` +
        `keyframe ${keyframe} ms; memory ${memory} MB`,
    );
  }
}

/**
 * @param {string} what
 * @param {number} decode
 * @param {number} surface
 */
function print(what, decode, surface) {
  const [decodeMs, surfaceMs, rate] = [decode, surface, 1000 / (decode + surface)].map((number) => number.toFixed(1));
  console.log(`${what}: decode ${decodeMs} ms, surface ${surfaceMs} ms, ${rate} frames a second`);
}

const [file, isv] = process.argv.slice(2);
if (file === undefined) {
  console.error('node player/bench/decode.js STREAM.isv [ISV]');
  process.exit(1);
}
const stream = new Uint8Array(readFileSync(file));
const decoder = await Decoder.create();
decoder.open(streamHeader(stream));
const packets = packetsByWalking(decoder, stream).map(({ bytes }) => bytes);
if (isv === '--parts') {
  compareParts();
  process.exit(0);
}
const runs = Array.from({ length: RUNS });
const decode = meanOfBest(runs.map(() => run(decoder, packets, { surface: false })));
const both = meanOfBest(runs.map(() => run(decoder, packets, { normals: true })));
const { positions, indices } = decoder.decode(packets[0]);
const memory = (decoder.memoryBytes / 1e6).toFixed(0);
console.log(`${packets.length} frames, ${positions.length / 3} vertices, ${indices.length / 3} triangles, ${memory} MB`);
print('WebAssembly', decode, both - decode);
if (isv !== undefined) {
  const native = runs.map(() => runNative(isv, file));
  const nativeDecode = meanOfBest(native.map((times) => times.decode));
  const nativeSurface = meanOfBest(native.map((times) => times.surface));
  print('native', nativeDecode, nativeSurface);
  const ratios = [decode / nativeDecode, (both - decode) / nativeSurface].map((ratio) => ratio.toFixed(2));
  console.log(`times of native: decode ${ratios[0]}, surface ${ratios[1]}`);
}
