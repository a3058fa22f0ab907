// A ladder of rates in headless Chromium, over a line that is slow.

import assert from 'node:assert/strict';
import { after, before, describe, test } from 'node:test';
import { writeBlob } from '../support/blob.js';
import { hasBrowser, launch } from '../support/browser.js';
import { clapSound } from '../support/clap.js';
import { laddered } from '../support/ladder.js';
import { soundIn } from '../support/mp4.js';
import { ISV_BIN, encoded, muxed } from '../support/native.js';
import { skipUnless } from '../support/need.js';
import { opened, shows, state } from '../support/page.js';
import { serve } from '../support/server.js';
import { repeated } from '../support/stream.js';

const missing = !hasBrowser ? 'there is no /usr/bin/chromium' : 'ISV_BIN names no program';
const skip = skipUnless(hasBrowser && Boolean(ISV_BIN), 'browser', missing, 'a ladder');

const SECONDS = 60;
/** Voxels of the rungs, whose rates are two times apart, and frames of a segment. Any machine decodes them as fast as they come. */
const VOXELS = ['14mm', '20mm', '30mm'];
const SEGMENT = 30;
/** Bytes of nothing for each byte of frames: then geometry needs more of the line than sound. */
const PADDING = 9;

describe('a ladder', { skip }, () => {
  /** @type {import('playwright-core').Browser} */
  let browser;
  /** @type {import('../support/server.js').Served} */
  let server;
  /** Bits a second of the rungs. @type {number[]} */
  let rates;

  before(async () => {
    const streams = VOXELS.map((voxel) =>
      repeated(encoded((folder) => writeBlob(folder, SEGMENT), ['--voxel', voxel, '--gop', String(SEGMENT)]), SECONDS * 30),
    );
    const sound = soundIn(muxed(streams[2], clapSound(SECONDS)));
    const files = laddered(streams, { sound, padding: PADDING });
    rates = [...Buffer.from(files['master.m3u8']).toString().matchAll(/BANDWIDTH=(\d+)/g)].map(([, rate]) => Number(rate));
    browser = await launch();
    server = await serve(files);
    const short = laddered(streams.map((stream) => repeated(stream, 4 * SEGMENT)), { padding: PADDING });
    for (const [name, bytes] of Object.entries(short)) server.files.set(`short/${name}`, bytes);
  });

  after(async () => {
    await browser?.close();
    await server?.close();
  });

  /** Segments that were asked for, in order. @returns {{ rung: number, segment: number }[]} */
  const asked = () =>
    server.requests.flatMap(({ path }) => {
      const match = /rung-(\d)\/(\d+)\.m4s/.exec(path);
      return match ? [{ rung: Number(match[1]), segment: Number(match[2]) }] : [];
    });

  /** Opens the ladder, and notes what happens. @param {string} [query] */
  async function open(query = '') {
    server.requests.length = 0;
    const { page, errors } = await opened(browser, `${server.url}?src=/files/master.m3u8${query}`);
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].shown && /** @type {any} */ (globalThis).isv.players[0].sound);
    await page.evaluate(() => {
      const { isv } = /** @type {any} */ (globalThis);
      const player = isv.players[0];
      const noted = { rungs: /** @type {number[]} */ ([]), lost: 0, waited: 0, longest: 0, shown: new Set() };
      Object.assign(globalThis, { noted });
      player.addEventListener('rung', (/** @type {any} */ { detail }) => noted.rungs.push(detail.rung));
      player.addEventListener('lost', () => noted.lost++);
      player.addEventListener('frame', (/** @type {any} */ { detail }) => noted.shown.add(detail.frame));
      let since = 0;
      player.addEventListener('waiting', () => (since = performance.now()));
      player.addEventListener('resumed', () => {
        const waited = (performance.now() - since) / 1000;
        noted.waited += waited;
        noted.longest = Math.max(noted.longest, waited);
      });
    });
    return { page, errors };
  }

  /** @param {import('playwright-core').Page} page */
  const noted = (page) =>
    page.evaluate(() => {
      const { rungs, lost, longest, shown } = /** @type {any} */ (globalThis).noted;
      return { rungs, lost, longest, frames: shown.size };
    });

  /** @param {import('playwright-core').Page} page @param {number} seconds of the take */
  const reaches = (page, seconds) =>
    page.waitForFunction((seconds) => /** @type {any} */ (globalThis).isv.clock.seconds >= seconds, seconds, { timeout: 120_000 });

  test('a slow line gets its rung within two segments, and nothing stalls for longer than one', async () => {
    // Room for the middle rung, not for the best.
    server.habits.rate = (1.5 * rates[1]) / 8;
    const { page, errors } = await open('&paused');
    await page.evaluate(() => /** @type {any} */ (globalThis).isv.toggle());
    await reaches(page, 8);
    const segments = asked();
    assert.equal(segments[0].rung, 2, 'the first picture comes soon');
    const settled = segments.filter(({ segment }) => segment >= 2);
    assert.ok(settled.length > 3);
    assert.ok(settled.every(({ rung }) => rung >= 1), `${JSON.stringify(segments)}`);
    const { lost, longest } = await noted(page);
    assert.equal(lost, 0);
    assert.ok(longest <= SEGMENT / 30, `it stalled for ${longest} s`);
    assert.ok((await page.evaluate(() => /** @type {any} */ (globalThis).isv.players[0].source.rungs.throughput)) < 2 * rates[1]);
    assert.deepEqual(errors, []);
  });

  test('a line that becomes slow is followed down, and up again', async () => {
    server.habits.rate = 0;
    const { page, errors } = await open('&paused');
    await page.evaluate(() => /** @type {any} */ (globalThis).isv.toggle());
    await reaches(page, 1);
    server.habits.rate = (1.5 * rates[2]) / 8;
    await reaches(page, 12);
    const slow = asked();
    server.habits.rate = 0;
    await reaches(page, 24);
    const all = asked();
    assert.equal(slow[slow.length - 1].rung, 2, JSON.stringify(slow));
    assert.equal(all[all.length - 1].rung, 0, JSON.stringify(all.slice(slow.length)));
    const { lost, longest } = await noted(page);
    assert.equal(lost, 0, 'rungs change without a gap');
    assert.ok(longest <= SEGMENT / 30, `it stalled for ${longest} s`);
    assert.deepEqual(errors, []);
  });

  test('a short take that goes round is seen at its best the second time', async () => {
    server.habits.rate = 0;
    const { page, errors } = await opened(browser, `${server.url}?src=/files/short/master.m3u8&paused`);
    const first = () => page.evaluate(() => /** @type {any} */ (globalThis).isv.players[0].ahead.get(0)?.stream);
    await shows(page, 0);
    assert.equal(await first(), 2);
    await page.evaluate(() => /** @type {any} */ (globalThis).isv.toggle());
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].ahead.get(0)?.stream === 0);
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].frame > 60);
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].frame < 60 && /** @type {any} */ (globalThis).isv.players[0].shown.stream === 0);
    assert.deepEqual(errors, []);
  });

  test('the page says which rung is shown', async () => {
    server.habits.rate = 0;
    const { page } = await open();
    await page.waitForFunction(() => /** @type {any} */ (globalThis).noted.rungs.length > 0);
    await page.locator('#cards', { hasText: /Rung[123] of 3/ }).waitFor();
    await page.locator('#cards', { hasText: /Network[\d.]+ [kM]bit/ }).waitFor();
  });

  test('frames of another rung have other triangles, and any frame can be gone to', async () => {
    server.habits.rate = 0;
    const { page, errors } = await open('&paused');
    const triangles = new Map();
    for (const frame of [0, 45, 1700, 44, 1799, 905]) {
      await page.evaluate((frame) => /** @type {any} */ (globalThis).isv.seek(frame), frame);
      await shows(page, frame);
      const { stream, size } = await page.evaluate(() => {
        const { shown, facts } = /** @type {any} */ (globalThis).isv.players[0];
        return { stream: shown.stream, size: facts.voxelSize };
      });
      assert.ok(Math.abs(size * 1000 - parseFloat(VOXELS[stream])) < 1e-6, `rung ${stream} has voxels of ${size}`);
      triangles.set(stream, (await state(page)).triangles);
    }
    const found = [...triangles.entries()].sort(([a], [b]) => a - b).map(([, count]) => count);
    assert.deepEqual(found, [...found].sort((a, b) => b - a), 'the better, the more');
    assert.deepEqual(errors, []);
  });
});
