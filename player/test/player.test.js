import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { afterEach, test } from 'node:test';
import { laddered } from './support/ladder.js';
import { fakeSound } from './support/mp4.js';
import { serve } from './support/server.js';
import './support/three.js';

const { IsvPlayer } = await import('../src/player.js');
const wasm = new WebAssembly.Module(await readFile(new URL('../src/isv.wasm', import.meta.url)));
const stream = new Uint8Array(await readFile(new URL('../../conformance/main_settled.isv', import.meta.url)));

/** What workers answer to a packet; null if they never do. @type {object | null} */
let answer = null;

Object.assign(globalThis, {
  Worker: class {
    onmessage = (/** @type {any} */ _) => {};
    #ended = false;

    constructor() {
      workers++;
    }

    terminate() {
      if (!this.#ended) workers--;
      this.#ended = true;
    }

    /** @param {any} order */
    postMessage({ do: what, run, frame }) {
      if (what === 'decode' && answer) setImmediate(() => this.onmessage({ data: { run, frame, ...answer } }));
    }
  },
});

/** Workers that have been started and not ended. */
let workers = 0;

/** @type {InstanceType<typeof IsvPlayer>[]} */
const players = [];

afterEach(() => {
  answer = null;
  for (const player of players.splice(0)) player.dispose();
});

/** @param {import('../src/player.js').PlayerOptions} options */
function begun(options) {
  const player = new IsvPlayer({ wasm, workers: 1, ...options });
  players.push(player);
  return player;
}

test('a player that is disposed of while it opens is no longer waited for', async () => {
  const player = begun({ source: stream });
  player.dispose();
  await assert.rejects(player.ready, { name: 'AbortError' });
});

test('a player that is disposed of no longer waits for a server', async () => {
  const server = await serve();
  server.habits.silent.add('/files/take.isv');
  const player = begun({ url: `${server.url}files/take.isv` });
  while (!server.requests.length) await new Promise((wake) => setTimeout(wake, 5));
  assert.equal(workers, 1);
  player.dispose();
  const begin = performance.now();
  while (workers && performance.now() - begin < 2000) await new Promise((wake) => setTimeout(wake, 5));
  assert.equal(workers, 0);
  await server.close();
});

test('a first frame that is refused, and a take without a good frame, are told without pictures being drawn', async () => {
  answer = { is: 'lost', message: 'too large', refused: true, blocks: 300_000 };
  await assert.rejects(begun({ source: stream }).ready, { name: 'IsvFailure', kind: 'limit', message: /^frame 0 needs/ });
  answer = { is: 'lost', message: 'wrong checksum' };
  await assert.rejects(begun({ source: stream }).ready, { name: 'IsvFailure', kind: 'damaged', message: 'no frame of it can be decoded: wrong checksum' });
});

test('a ladder whose sound the server does not have says so', async () => {
  const { 'sound/stream.m3u8': _, ...files } = laddered([stream], { sound: fakeSound(1) });
  const server = await serve(files);
  const url = `${server.url}files/master.m3u8`;
  const silent = new Promise((told) => begun({ url }).addEventListener('silent', (event) => told(/** @type {CustomEvent} */ (event).detail)));
  assert.deepEqual(await silent, { message: 'the take plays without sound: stream.m3u8: the server has no such file' });
  await server.close();
});
