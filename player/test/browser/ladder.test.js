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
      const noted = { rungs: /** @type {number[]} */ ([]), lost: 0, waited: 0, longest: 0, shown: new Set(), samples: /** @type {any[]} */ ([]) };
      const said = () => /** @type {any} */ (globalThis).document.getElementById('messages').textContent;
      const sample = () => ({ at: player.clock.seconds, frame: player.shownFrame, heard: player.sound?.element.currentTime, said: said() });
      setInterval(() => noted.samples.push(sample()), 20);
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

  /** Makes segments bad while something is done. @param {Record<string, (bytes: Uint8Array) => Uint8Array | null>} how null: missing @param {() => Promise<void>} what */
  async function damaged(how, what) {
    const were = Object.keys(how).map((name) => /** @type {[string, Uint8Array]} */ ([name, server.files.get(name)]));
    for (const [name, bytes] of were) {
      const bad = how[name](bytes);
      if (bad) server.files.set(name, bad);
      else server.files.delete(name);
    }
    await what().finally(() => were.forEach(([name, bytes]) => server.files.set(name, bytes)));
  }

  const missing = () => null;
  const cut = (/** @type {Uint8Array} */ bytes) => bytes.subarray(0, bytes.length / 20);
  /** Wrong in the first packet, which its checksum tells. @param {Uint8Array} bytes */
  const garbled = (bytes) => {
    const at = Buffer.from(bytes).indexOf('mdat') + 104;
    return bytes.map((byte, place) => (place >= at && place < at + 40 ? byte ^ 0xff : byte));
  };

  test('segments that no rung has whole hold the picture, sound goes on, and the page says so', async () => {
    server.habits.rate = 0;
    const bad = Object.fromEntries(
      [0, 1, 2].flatMap((rung) => [
        [`rung-${rung}/2.m4s`, missing],
        [`rung-${rung}/4.m4s`, garbled],
        [`rung-${rung}/6.m4s`, rung === 0 ? cut : (/** @type {Uint8Array} */ bytes) => bytes],
      ]),
    );
    await damaged(bad, async () => {
      const { page } = await open('&paused');
      await page.evaluate(() => /** @type {any} */ (globalThis).isv.toggle());
      await reaches(page, 8);
      await page.locator('#messages', { hasText: /the picture stands still/ }).waitFor({ state: 'detached' });
      const { shown, samples } = await page.evaluate(() => {
        const { shown, samples } = /** @type {any} */ (globalThis).noted;
        return { shown: [...shown], samples };
      });
      const says = (/** @type {RegExp} */ words) => assert.ok(samples.some((/** @type {any} */ { said }) => words.test(said)), String(words));
      says(/frame 60 is missing \(2\.m4s: the server has no such file\); it goes on at frame 90/);
      says(/frame 120 is damaged .*; it goes on at frame 150/);
      const held = samples.filter((/** @type {any} */ { at }) => at > 2.05 && at < 2.95);
      assert.ok(held.some((/** @type {any} */ { said }) => said.includes('the picture stands still up to frame 90')), JSON.stringify(held));
      assert.ok(held.length > 1 && held.every((/** @type {any} */ { frame }) => frame < 60), JSON.stringify(held));
      // Sound leads the clock all the while.
      assert.ok(held.every((/** @type {any} */ { at, heard }) => heard > at - 0.05), JSON.stringify(held));
      const between = (/** @type {number} */ a, /** @type {number} */ b) => shown.filter((frame) => frame >= a && frame < b).length;
      assert.deepEqual([between(60, 90), between(120, 150)], [0, 0]);
      for (const begin of [90, 150, 180]) assert.ok(between(begin, begin + 30) > 0, `frames from ${begin} on are shown`);
      assert.equal(await page.evaluate(() => /** @type {any} */ (globalThis).isv.players[0].error), null);
    });
  });

  test('sound that is missing or damaged is passed over, geometry goes on, and sound comes again', async () => {
    server.habits.rate = 0;
    await damaged({ 'sound/2.m4s': missing, 'sound/5.m4s': cut }, async () => {
      const { page } = await open('&paused');
      await page.evaluate(() => /** @type {any} */ (globalThis).isv.toggle());
      await reaches(page, 8);
      const said = await page.evaluate(() => /** @type {any} */ (globalThis).noted.samples.map((/** @type {any} */ { said }) => said).join());
      assert.match(said, /sound is missing from 2\.0 to 3\.0 s \(2\.m4s: the server has no such file\)/);
      assert.equal((await noted(page)).lost, 0);
      const shown = await page.evaluate(() => [.../** @type {any} */ (globalThis).noted.shown]);
      for (const second of [2, 5]) assert.ok(shown.some((frame) => Math.floor(frame / 30) === second), `second ${second} is shown without sound`);
      const { behind, seconds, playing } = await page.evaluate(() => {
        const { sound, clock } = /** @type {any} */ (globalThis).isv.players[0];
        return { behind: clock.seconds - sound.element.currentTime, seconds: clock.seconds, playing: !sound.element.paused };
      });
      // The clock is as old as the last picture, on a machine that draws slowly.
      assert.ok(playing && Math.abs(behind) < 0.5, `at ${seconds} s sound is ${behind} s behind`);
    });
  });

  test('a ladder whose segments are all gone ends with a reason', async () => {
    server.habits.rate = 0;
    const gone = Object.fromEntries([0, 1, 2].flatMap((rung) => Array.from({ length: 55 }, (_, at) => [`rung-${rung}/${at + 5}.m4s`, missing])));
    await damaged(gone, async () => {
      const { page } = await open('&paused');
      await page.evaluate(() => /** @type {any} */ (globalThis).isv.seek(140));
      await page.evaluate(() => /** @type {any} */ (globalThis).isv.toggle());
      await page.locator('#messages', { hasText: /10 parts of it in a row cannot be played/ }).waitFor({ timeout: 60_000 });
    });
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
