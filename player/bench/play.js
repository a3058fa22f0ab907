// How fast the player is in headless Chromium, over loopback:
//
//   node player/bench/play.js STREAM.isv [GOP]
//
// STREAM.isv is repeated to 60 seconds, a keyframe every GOP frames (30, or as many as the stream has): frames a second decoded and
// surfaced by all workers while nothing is drawn, time from opening the page to the first picture, and seeks to cold frames.

import { readFileSync } from 'node:fs';
import { launch } from '../test/support/browser.js';
import { serve } from '../test/support/server.js';
import { packetsOf, repeated } from '../test/support/stream.js';

const SEEKS = 20;
const OPENINGS = 5;

const [path, gop = '30'] = process.argv.slice(2);
if (!path) throw new Error('node bench/play.js STREAM.isv [GOP]');
const stream = new Uint8Array(readFileSync(path));
const header = new DataView(stream.buffer);
const fps = header.getUint32(24, true) / header.getUint32(28, true);
const taken = Math.min(Number(gop), packetsOf(stream).length);
const long = repeated(stream, Math.round(60 * fps), { gop: taken });
const server = await serve({ 'long.isv': long });
const browser = await launch();

/** A page with the long file. @param {string} [query] */
async function open(query = '') {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
  const page = await context.newPage();
  await page.goto(`${server.url}?src=/files/long.isv${query}`, { waitUntil: 'commit' });
  await page.waitForFunction(() => /** @type {any} */ (globalThis).isv?.players[0]?.shown, undefined, {
    polling: 5,
    timeout: 60_000,
  });
  return page;
}

/** When the first picture was drawn, in ms after the page was asked for. */
async function firstPicture() {
  const page = await open('&paused');
  const ms = await page.evaluate(() => /** @type {any} */ (globalThis).isv.firstPictureMs);
  await page.context().close();
  return ms;
}

/** Frames a second by all workers, with a ring that has room for them and nothing drawn. */
async function rate() {
  const page = await open('&paused');
  const found = await page.evaluate(async () => {
    const { IsvPlayer } = await import(/** @type {any} */ ('/src/index.js'));
    const page = /** @type {any} */ (globalThis).isv;
    for (const player of page.players) player.dispose();
    page.players = [];
    const player = new IsvPlayer({ url: '/files/long.isv', memory: 1 << 30 });
    await player.ready;
    const from = { at: performance.now(), held: player.ahead.held };
    const turning = setInterval(() => player.update(), 16);
    await new Promise((wake) => setTimeout(wake, 4000));
    clearInterval(turning);
    const fps = (1000 * (player.ahead.held - from.held)) / (performance.now() - from.at);
    const { workers, bytes, budget } = player.ahead;
    const { decodeMs, surfaceMs } = player.ahead.get(8);
    player.dispose();
    return { fps, workers, full: bytes > 0.7 * budget, decodeMs, surfaceMs };
  });
  await page.context().close();
  return found;
}

/** Times of seeks to frames that are not there, in ms, until they are drawn. */
async function seeks() {
  const page = await open('&paused');
  const times = await page.evaluate(
    async ({ count, gop }) => {
      const page = /** @type {any} */ (globalThis).isv;
      const [player] = page.players;
      const times = [];
      for (let seek = 0; seek < count; seek++) {
        // Every place in a GOP comes by, the last one, which takes longest, first.
        const inGop = Math.round(((count - 1 - seek) / (count - 1)) * (gop - 1));
        const frame = gop * ((7 + 13 * seek) % Math.floor(player.frames / gop)) + inGop;
        const begin = performance.now();
        page.seek(frame);
        while (player.shownFrame !== frame) await new Promise(requestAnimationFrame);
        times.push(performance.now() - begin);
        await new Promise((wake) => setTimeout(wake, 100));
      }
      return times;
    },
    { count: SEEKS, gop: taken },
  );
  await page.context().close();
  return times;
}

/** @param {number[]} times */
const summary = (times) => {
  const sorted = [...times].sort((a, b) => a - b);
  return `median ${Math.round(sorted[sorted.length >> 1])} ms, longest ${Math.round(sorted[sorted.length - 1])} ms`;
};

console.log(`${path}: 60 s, ${(long.length / 1e6).toFixed(1)} MB, a keyframe every ${taken} frames`);
const { fps: rated, workers, full, decodeMs, surfaceMs } = await rate();
console.log(`decoded and surfaced: ${rated.toFixed(1)} frames a second by ${workers} workers${full ? ' (memory was full)' : ''}`);
console.log(`a frame: ${decodeMs.toFixed(1)} ms to decode, ${surfaceMs.toFixed(1)} ms for the surface, while the others work`);
const openings = [];
for (let opening = 0; opening < OPENINGS; opening++) openings.push(await firstPicture());
console.log(`first picture: ${summary(openings)}`);
console.log(`seeks: ${summary(await seeks())}`);
await browser.close();
await server.close();
