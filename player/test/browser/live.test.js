// A live stream in headless Chromium, from a server that is killed and comes again.

import assert from 'node:assert/strict';
import { appendFileSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { readFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, test } from 'node:test';
import { hasBrowser, launch } from '../support/browser.js';
import { serveLive } from '../support/live-server.js';
import { ISV_BIN, serving } from '../support/native.js';
import { skipUnless } from '../support/need.js';
import { opened } from '../support/page.js';
import { serve } from '../support/server.js';
import { packetsOf, repeated } from '../support/stream.js';

/** A file that is written as a running encoder writes it, 15 frames a second; one that is there is replaced. */
class GrowingFile {
  #timer;

  /** @param {string} path @param {Uint8Array} stream played over and over */
  constructor(path, stream) {
    const long = repeated(stream, 10_000);
    const packets = packetsOf(long);
    writeFileSync(path, long.subarray(0, 48));
    let next = 0;
    this.#timer = setInterval(() => appendFileSync(path, packets[next++]), 1000 / 15);
  }

  kill() {
    clearInterval(this.#timer);
  }
}

const skip = skipUnless(hasBrowser, 'browser', 'there is no /usr/bin/chromium', 'a live stream');

describe('a live stream', { skip }, () => {
  /** @type {import('playwright-core').Browser} */
  let browser;
  /** @type {import('../support/server.js').Served} */
  let server;
  /** @type {Uint8Array} */
  let stream;

  before(async () => {
    stream = await readFile(new URL('../../../conformance/main_settled.isv', import.meta.url));
    server = await serve();
    browser = await launch();
  });

  after(async () => {
    await browser?.close();
    await server?.close();
  });

  /** Waits until so many more frames have been shown. @param {import('playwright-core').Page} page @param {number} frames */
  async function goesOn(page, frames) {
    const from = await page.evaluate(() => /** @type {any} */ (globalThis).isv.players[0].shownFrame);
    await page.waitForFunction((until) => /** @type {any} */ (globalThis).isv.players[0].shownFrame >= until, from + frames, {
      timeout: 60_000,
    });
  }

  test('is shown with its latency, and outlives its source and its server', async () => {
    let live = await serveLive(stream);
    const { page } = await opened(browser, `${server.url}?live=ws://127.0.0.1:${live.port}/live`);
    try {
      await goesOn(page, 8);
      const latency = await page.evaluate(() => /** @type {any} */ (globalThis).isv.players[0].live.latencyMs);
      assert.ok(latency > 0 && latency < 30_000, `${latency} ms`);
      await page.locator('#cards', { hasText: /Latency\d+ ms/ }).waitFor();
      live.restart();
      await goesOn(page, 8);
      await live.kill();
      await page.locator('#messages', { hasText: 'server has gone away' }).waitFor();
      live = await serveLive(stream, live.port);
      await goesOn(page, 8);
      assert.equal(await page.locator('#messages', { hasText: 'gone away' }).count(), 0);
    } finally {
      await live.kill().catch(() => {});
    }
  });

  const skip = skipUnless(Boolean(ISV_BIN), 'browser', 'ISV_BIN names no program', 'a live stream of the program');
  test('ends for good when standard input does, and so does the program', { skip }, async () => {
    const live = await serving(['serve', '--live', '-', '--bind', '127.0.0.1:0']);
    try {
      // The address alone opens the only stream there is.
      const { page } = await opened(browser, new URL('/', live.url).href);
      const [first, ...rest] = packetsOf(stream);
      live.stdin.write(stream.subarray(0, 48));
      // Who comes after a keyframe waits for the next one.
      await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0]?.facts);
      live.stdin.write(first);
      await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0]?.shown);
      live.stdin.end(Buffer.concat(rest.slice(0, 3)));
      await page.locator('#messages', { hasText: 'The stream has ended' }).waitFor();
      assert.equal(await live.status, 0);
      await page.waitForTimeout(1500);
      assert.equal(await page.locator('#messages', { hasText: 'gone away' }).count(), 0);
    } finally {
      live.close();
    }
  });

  test('comes from the program itself, and outlives its source and the program', { skip }, async () => {
    const folder = mkdtempSync(join(tmpdir(), 'isv-live-'));
    const path = join(folder, 'take.isv');
    let source = new GrowingFile(path, stream);
    let live = await serving(['serve', '--live', path, '--bind', '127.0.0.1:0']);
    const { port } = new URL(live.url);
    try {
      const { page, errors } = await opened(browser, live.url);
      await goesOn(page, 8);
      source.kill();
      source = new GrowingFile(path, stream);
      await goesOn(page, 8);
      assert.deepEqual(errors, []);
      live.close();
      await page.locator('#messages', { hasText: 'server has gone away' }).waitFor();
      live = await serving(['serve', '--live', path, '--bind', `127.0.0.1:${port}`]);
      await goesOn(page, 8);
    } finally {
      live.close();
      source.kill();
      rmSync(folder, { recursive: true });
    }
  });
});
