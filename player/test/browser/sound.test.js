// Sound in headless Chromium: a clap, whose geometry is large for a moment at every second, and whose sound clicks there.

import assert from 'node:assert/strict';
import { after, before, describe, test } from 'node:test';
import { hasBrowser, launch } from '../support/browser.js';
import { FPS, RADII, clapSound, clapStream } from '../support/clap.js';
import { fakeSound, muxed as muxedByHand, soundIn } from '../support/mp4.js';
import { ISV_BIN, muxed, packaged, viewed } from '../support/native.js';
import { skipUnless } from '../support/need.js';
import { opened, shows } from '../support/page.js';
import { serve } from '../support/server.js';
import { metadataPacket } from '../support/stream.js';
import { measure, measured } from '../support/sync.js';

const missing = !hasBrowser ? 'there is no /usr/bin/chromium' : 'ISV_BIN names no program';
const skip = skipUnless(hasBrowser && Boolean(ISV_BIN), 'browser', missing, 'sound');

/** Most seconds between what is seen and what is heard. */
const APART = 0.02;
const SECONDS = 122;

describe('sound', { skip }, () => {
  /** @type {import('playwright-core').Browser} */
  let browser;
  /** @type {import('../support/server.js').Served} */
  let server;
  /** @type {Uint8Array} */
  let stream;

  before(async () => {
    stream = clapStream(SECONDS);
    const few = clapStream(4);
    browser = await launch();
    const clap = muxed(stream, clapSound(SECONDS));
    server = await serve({
      'clap.mp4': clap,
      // Far more than is read ahead.
      'spread.mp4': muxedByHand(stream, { sound: soundIn(clap), padding: 1 << 17 }),
      'short-sound.mp4': muxed(few, clapSound(2)),
      'long-sound.mp4': muxed(few, clapSound(7)),
      'silent.mp4': muxed(few),
      'strange.mp4': muxedByHand(few, { sound: fakeSound(4, new Uint8Array([0, 0, 0, 36, ...Buffer.from('ipcm'), ...new Array(28).fill(0)])) }),
      'broken.mp4': muxedByHand(few, { sound: fakeSound(4) }),
      'titled.mp4': muxedByHand(few, { metadata: metadataPacket({ title: 'A clap', up: 'z' }) }),
    });
  });

  after(async () => {
    await browser?.close();
    await server?.close();
  });

  /** @param {string} query @param {import('../support/page.js').Screen} [screen] */
  const open = (query, screen) => opened(browser, server.url + query, screen);

  /** @param {import('playwright-core').Page} page @param {(isv: any) => void} act */
  const act = (page, act) => page.evaluate(`(${act})(globalThis.isv)`);

  /** Waits until sound has played so many seconds more. @param {import('playwright-core').Page} page @param {number} seconds */
  async function plays(page, seconds) {
    const from = await page.evaluate(() => /** @type {any} */ (globalThis).isv.players[0].sound.element.currentTime);
    const past = (/** @type {number[]} */ [from, seconds]) => {
      const { element } = /** @type {any} */ (globalThis).isv.players[0].sound;
      return element.currentTime > from + seconds || element.currentTime < from - 0.1;
    };
    await page.waitForFunction(past, [from, seconds], { timeout: 60_000 });
  }

  /** Moves the playhead, and waits until sound is there. @param {import('playwright-core').Page} page @param {number} frame */
  async function seeks(page, frame) {
    await page.evaluate((frame) => /** @type {any} */ (globalThis).isv.seek(frame), frame);
    const there = (/** @type {number} */ seconds) => {
      const { element } = /** @type {any} */ (globalThis).isv.players[0].sound;
      return !element.seeking && Math.abs(element.currentTime - seconds) < 0.5;
    };
    await page.waitForFunction(there, frame / FPS, { timeout: 60_000 });
    await measured(page);
  }

  /** @param {import('playwright-core').Page} page @param {string} what @param {{ heard?: boolean }} [options] */
  async function isTogether(page, what, { heard = true } = {}) {
    const { pictures, worst, wrong, clicks } = await measured(page);
    assert.ok(pictures > 5, `${what}: ${pictures} pictures`);
    assert.ok(worst <= APART, `${what}: a picture was ${worst} s off`);
    assert.equal(wrong, 0, `${what}: pictures of another time`);
    if (!heard) return;
    assert.ok(clicks.length > 0, `${what}: no click was heard`);
    const median = clicks.sort((a, b) => Math.abs(a) - Math.abs(b))[clicks.length >> 1];
    assert.ok(Math.abs(median) <= APART, `${what}: clicks ${clicks}`);
  }

  test('geometry goes with sound, after seeks and at other speeds', async () => {
    const { page, errors } = await open('?src=/files/clap.mp4&paused');
    await measure(page, (RADII.small + RADII.large) / 2);
    await act(page, (isv) => isv.toggle());
    await plays(page, 3.5);
    await isTogether(page, 'from the beginning');
    for (const second of [60, 20, 118]) {
      await seeks(page, second * FPS - 10);
      await plays(page, 2.5);
      await isTogether(page, `after a seek to ${second} s`);
    }
    for (const speed of [2, 0.5]) {
      await page.evaluate((speed) => (/** @type {any} */ (globalThis).isv.clock.speed = speed), speed);
      await seeks(page, 40 * FPS);
      await plays(page, 0.3);
      await measured(page);
      await plays(page, speed * 3);
      await isTogether(page, `at ${speed} times the speed`);
    }
    assert.deepEqual(errors, []);
  });

  test('it goes round', async () => {
    const { page } = await open('?src=/files/clap.mp4&paused');
    await measure(page, (RADII.small + RADII.large) / 2);
    await act(page, (isv) => isv.toggle());
    await seeks(page, (SECONDS - 2) * FPS);
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.clock.seconds < 10, undefined, { timeout: 60_000 });
    await measured(page);
    await plays(page, 2.2);
    await isTogether(page, 'the second time');
  });

  test('sound waits for geometry, and geometry for sound, on a network that stalls', async () => {
    // Slow enough that the place it goes to has not been read ahead.
    server.habits.rate = 3 << 20;
    const { page } = await open('?src=/files/spread.mp4&paused');
    await measure(page, (RADII.small + RADII.large) / 2);
    await act(page, (isv) => isv.toggle());
    await plays(page, 1);
    server.habits.missing.add('/files/spread.mp4');
    try {
      // Neither is there yet.
      await page.evaluate((frame) => /** @type {any} */ (globalThis).isv.seek(frame), 80 * FPS + 3);
      await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].waiting);
      await page.locator('#messages', { hasText: 'trying again' }).waitFor();
      const { at } = await measured(page);
      assert.ok(Math.abs(at - 80.1) < 1e-3, `sound stands still at ${at}`);
    } finally {
      server.habits.missing.clear();
      server.habits.rate = 0;
    }
    await plays(page, 2.5);
    await isTogether(page, 'after it has come back');
    // Geometry that comes late, while sound is there.
    await page.evaluate(() => {
      const { ahead } = /** @type {any} */ (globalThis).isv.players[0];
      const { settled, firstMissing } = ahead;
      Object.assign(globalThis, { late: () => Object.assign(ahead, { settled, firstMissing }) });
      Object.assign(ahead, { settled: () => false, firstMissing: (/** @type {number} */ frame) => frame });
    });
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].sound.element.paused);
    const before = (await measured(page)).at;
    await page.waitForTimeout(700);
    assert.equal((await measured(page)).at, before, 'sound waits');
    await page.evaluate(() => /** @type {any} */ (globalThis).late());
    await plays(page, 2.5);
    await isTogether(page, 'after geometry has come');
  });

  test('a ladder of the program plays with its sound', async () => {
    for (const [name, bytes] of packaged(clapStream(8), clapSound(8), 2)) server.files.set(`site/${name}`, bytes);
    const { page, errors } = await open('?src=/files/site/master.m3u8&paused');
    await measure(page, (RADII.small + RADII.large) / 2);
    const { frames, all } = await page.evaluate(() => {
      const [player] = /** @type {any} */ (globalThis).isv.players;
      return { frames: player.frames, all: player.source.rungs.all };
    });
    assert.deepEqual([frames, all.length], [8 * FPS, 2]);
    assert.match(all[0].codecs, /^isv1\.1\.[12],opus$/);
    await act(page, (isv) => isv.toggle());
    await plays(page, 3.5);
    await isTogether(page, 'a ladder');
    await seeks(page, 5 * FPS - 5);
    await plays(page, 2);
    await isTogether(page, 'a ladder after a seek');
    assert.deepEqual(errors, []);
  });

  test('sound is heard from the program itself, whose pages may load little', async () => {
    const served = await viewed([/** @type {Uint8Array} */ (server.files.get('short-sound.mp4'))]);
    try {
      const { page, errors } = await opened(browser, served.url);
      await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0]?.sound?.element.currentTime > 0.5);
      assert.deepEqual(errors, []);
    } finally {
      served.close();
    }
  });

  test('a hidden page is silent, and goes on where it was', async () => {
    const { page } = await open('?src=/files/clap.mp4&paused');
    await measure(page, (RADII.small + RADII.large) / 2);
    await act(page, (isv) => isv.toggle());
    await plays(page, 1);
    const hide = (/** @type {boolean} */ hidden) =>
      page.evaluate((hidden) => {
        Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });
        document.dispatchEvent(new Event('visibilitychange'));
      }, hidden);
    await hide(true);
    const { at } = await measured(page);
    await page.waitForTimeout(1000);
    assert.equal((await measured(page)).at, at);
    await hide(false);
    await plays(page, 2.5);
    await isTogether(page, 'after it was hidden');
  });

  test('sound that is shorter ends, and geometry goes on; sound that is longer is cut off', async () => {
    for (const [name, seconds] of /** @type {[string, number][]} */ ([['short-sound.mp4', 2], ['long-sound.mp4', 4]])) {
      const { page, errors } = await open(`?src=/files/${name}&paused`);
      await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].sound);
      await page.evaluate(() => {
        const { isv } = /** @type {any} */ (globalThis);
        const seen = { last: 0, frames: new Set(), wrapped: 0 };
        Object.assign(globalThis, { seen });
        isv.players[0].sound.element.addEventListener('timeupdate', () => (seen.last = Math.max(seen.last, isv.players[0].sound.element.currentTime)));
        isv.players[0].addEventListener('frame', (/** @type {any} */ { detail }) => seen.frames.add(detail.frame));
        isv.players[0].addEventListener('wrapped', () => seen.wrapped++);
        isv.toggle();
      });
      await page.waitForFunction(() => /** @type {any} */ (globalThis).seen.wrapped >= 2, undefined, { timeout: 60_000 });
      const { last, late } = await page.evaluate(() => {
        const { last, frames } = /** @type {any} */ (globalThis).seen;
        return { last, late: Math.max(...frames) };
      });
      assert.ok(late >= 4 * FPS - 10, `${name}: frame ${late}`);
      assert.ok(Math.abs(last - seconds) < 0.35, `${name}: sound to ${last}`);
      assert.deepEqual(errors, []);
    }
  });

  test('of two takes side by side, the first is heard, and both go with it', async () => {
    const { page, errors } = await open('?src=/files/clap.mp4&compare=/files/short-sound.mp4');
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].sound?.element.currentTime > 2.2);
    const { sounds, frames } = await page.evaluate(() => {
      const { players } = /** @type {any} */ (globalThis).isv;
      return { sounds: players.map((/** @type {any} */ { sound }) => sound !== null), frames: players.map((/** @type {any} */ { frame }) => frame) };
    });
    assert.deepEqual(sounds, [true, false]);
    assert.equal(frames[0], frames[1]);
    // It goes round with the shorter one.
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].sound.element.currentTime < 1);
    assert.deepEqual(errors, []);
  });

  test('volume and mute have buttons and keys', async () => {
    const { page } = await open('?src=/files/clap.mp4&paused');
    await page.locator('#sound').waitFor();
    const heard = () =>
      page.evaluate(() => {
        const { volume, muted } = /** @type {any} */ (globalThis).isv.players[0].sound.element;
        return { volume, muted };
      });
    assert.deepEqual(await heard(), { volume: 1, muted: false });
    await page.keyboard.press('m');
    assert.deepEqual(await heard(), { volume: 1, muted: true });
    await page.locator('[data-do=mute][aria-pressed=true]').waitFor();
    await page.getByRole('button', { name: 'Mute' }).click();
    assert.deepEqual(await heard(), { volume: 1, muted: false });
    await page.locator('#canvas').focus();
    for (let presses = 0; presses < 3; presses++) await page.keyboard.press('ArrowDown');
    assert.ok(Math.abs((await heard()).volume - 0.7) < 1e-6);
    await page.keyboard.press('ArrowUp');
    await page.locator('#volume').fill('0.25');
    assert.deepEqual(await heard(), { volume: 0.25, muted: false });
    await page.locator('#volume').fill('0');
    assert.equal((await heard()).muted, true);
  });

  test('a take without sound has no buttons for it', async () => {
    const { page, errors } = await open('?src=/files/silent.mp4');
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].shownFrame > 3);
    assert.equal(await page.locator('#sound').isVisible(), false);
    assert.deepEqual(errors, []);
  });

  test('sound that the browser cannot play is said, and the take plays', async () => {
    for (const [name, says] of [
      ['strange.mp4', /without sound: this browser does not play PCM from MP4/],
      ['broken.mp4', /without sound/],
    ]) {
      const { page } = await open(`?src=/files/${name}`);
      const message = page.locator('#messages', { hasText: 'without sound' });
      await message.waitFor();
      assert.match((await message.textContent()) ?? '', /** @type {RegExp} */ (says));
      await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].shownFrame > 5);
    }
  });

  for (const silent of [true, false]) {
    const how = silent ? 'muted' : 'without it';
    test(`where sound may not begin by itself, the take plays ${how} and says so`, async () => {
      const context = await browser.newContext();
      try {
        // A policy as browsers have it: what drives this one counts as a user.
        await context.addInitScript((silent) => {
          const { play } = HTMLMediaElement.prototype;
          let touched = false;
          addEventListener('click', () => (touched = true), true);
          HTMLMediaElement.prototype.play = function () {
            const may = touched || (silent && this.muted);
            return may ? play.call(this) : Promise.reject(new DOMException('no', 'NotAllowedError'));
          };
        }, silent);
        const page = await context.newPage();
        await page.goto(`${server.url}?src=/files/clap.mp4`);
        const hint = page.getByRole('button', { name: 'Turn it on' });
        await hint.waitFor();
        await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].shownFrame > 10);
        assert.equal(await page.evaluate(() => /** @type {any} */ (globalThis).isv.players[0].muted), true);
        await hint.click();
        await hint.waitFor({ state: 'detached' });
        await page.waitForFunction(() => {
          const { sound, shownFrame, source } = /** @type {any} */ (globalThis).isv.players[0];
          const { muted, paused, currentTime } = sound.element;
          return !muted && !paused && currentTime > 1 && Math.abs(currentTime - source.times.starts[shownFrame]) < 0.3;
        });
      } finally {
        await context.close();
      }
    });
  }

  test('a take says what it is called and what is up', async () => {
    const { page } = await open('?src=/files/titled.mp4&paused');
    await shows(page, 0);
    assert.equal(await page.evaluate(() => /** @type {any} */ (globalThis).isv.stage.up), 'z');
    assert.match(await page.title(), /^A clap/);
    await page.locator('#cards', { hasText: 'A clap' }).waitFor();
    const { page: chosen } = await open('?src=/files/titled.mp4&paused&up=x');
    await shows(chosen, 0);
    assert.equal(await chosen.evaluate(() => /** @type {any} */ (globalThis).isv.players[0].up), 'x');
  });

  test('a file of this device plays with its sound', async () => {
    const { page } = await open('');
    const buffer = Buffer.from(/** @type {Uint8Array} */ (server.files.get('short-sound.mp4')));
    await page.locator('#file').setInputFiles({ name: 'mine.mp4', mimeType: 'video/mp4', buffer });
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0]?.sound?.element.currentTime > 0.5);
  });

  test('the page with sound fits a phone', async () => {
    const { page } = await open('?src=/files/clap.mp4&paused', { width: 360, height: 740, touch: true });
    await page.locator('#sound').waitFor();
    const wide = await page.evaluate(() =>
      [...document.querySelectorAll('#transport *, #cards *')].filter((one) => one.getBoundingClientRect().right > innerWidth + 1).map((one) => one.outerHTML.slice(0, 80)),
    );
    assert.deepEqual(wide, []);
  });
});
