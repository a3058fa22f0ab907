// Colour in headless Chromium, against what was encoded and what the native program makes of it. Needs `ISV_BIN`.

import assert from 'node:assert/strict';
import { after, before, describe, test } from 'node:test';
import { Decoder } from '../../src/wasm.js';
import { packetsByWalking, streamHeader } from '../streams.js';
import { hasBrowser, launch } from '../support/browser.js';
import { ISV_BIN, blobStream, decodedMeshes, parsePng, rendered, serving } from '../support/native.js';
import { nativeCamera } from '../support/native-camera.js';
import { skipUnless } from '../support/need.js';
import { opened, shows } from '../support/page.js';
import { serve } from '../support/server.js';
import { metadataPacket, packetsOf } from '../support/stream.js';

const missing = !hasBrowser ? 'there is no /usr/bin/chromium' : 'ISV_BIN names no program';
const skip = skipUnless(hasBrowser && Boolean(ISV_BIN), 'browser', missing, 'colour');

/** A colour a frame, dark ones and light ones. */
const PLAIN = [
  [200, 60, 90],
  [12, 30, 60],
  [250, 240, 10],
  [3, 4, 2],
  [128, 127, 129],
  [40, 180, 220],
];
/** Stripes that go round with the surface. @type {import('../support/blob.js').Paint} */
const STRIPES = (_, [x, y, z]) => [128 + 100 * Math.sin(8 * y), 120 + 90 * Math.sin(6 * x), 128 + 80 * Math.cos(7 * z)];

describe('colour', { skip }, () => {
  /** @type {import('playwright-core').Browser} */
  let browser;
  /** @type {import('../support/server.js').Served} */
  let server;
  /** @type {Uint8Array} */
  let plain;
  /** @type {Uint8Array} */
  let striped;

  before(async () => {
    plain = blobStream(PLAIN.length, { paint: (frame) => PLAIN[frame], gop: 1 });
    striped = blobStream(8, { paint: STRIPES, gop: 4 });
    browser = await launch();
    server = await serve({ 'plain.isv': plain, 'striped.isv': striped, 'grey.isv': blobStream(2) });
  });

  after(async () => {
    await browser?.close();
    await server?.close();
  });

  /** @param {string} query @param {import('../support/page.js').Screen} [screen] */
  const open = (query, screen) => opened(browser, server.url + query, screen);

  test("vertices have the native program's colours, from every keyframe on", async () => {
    const natives = decodedMeshes(striped);
    const decoder = await Decoder.create();
    assert.equal(decoder.open(streamHeader(striped)).colour, true);
    const packets = packetsByWalking(decoder, striped);
    for (const from of [0, 4]) {
      decoder.open(streamHeader(striped));
      for (let frame = from; frame < packets.length; frame++) {
        const { positions, colours } = decoder.decode(packets[frame].bytes);
        assert.deepEqual(positions, natives[frame].positions, `frame ${frame}`);
        assert.deepEqual(colours, natives[frame].colours, `frame ${frame}`);
        assert.equal(colours.length, positions.length);
      }
    }
    assert.equal(decoder.decode(packets[0].bytes, { surface: false }).colours.length, 0);
    assert.equal(decoder.open(streamHeader(striped), { colour: false }).colour, false);
    assert.equal(decoder.decode(packets[0].bytes).colours.length, 0, 'colour that is not wanted is not decoded');
  });

  test('a colour that goes in comes out on the canvas, wherever is sought', async () => {
    const { page, errors } = await open('?src=/files/plain.isv&paused');
    for (const frame of [0, 4, 2, 5, 1, 3]) {
      await page.evaluate((frame) => /** @type {any} */ (globalThis).isv.seek(frame), frame);
      await shows(page, frame);
      near(await middle(page), PLAIN[frame], `frame ${frame}`);
    }
    assert.deepEqual(errors, []);
  });

  test('it is shown at first, and other views remain', async () => {
    const { page } = await open('?src=/files/plain.isv&paused');
    await shows(page, 0);
    const checked = page.locator('#views input:checked');
    assert.equal(await checked.inputValue(), 'colour');
    assert.ok(await page.locator('#views label', { hasText: 'Colour' }).isVisible());
    await page.keyboard.press('1');
    assert.equal(await checked.inputValue(), 'shaded');
    const [red, green, blue] = await middle(page);
    assert.ok(Math.max(red, green, blue) - Math.min(red, green, blue) < 30, `grey in light: ${[red, green, blue]}`);
    await page.keyboard.press('2');
    assert.equal(await checked.inputValue(), 'normals');
    assert.ok(apart(await middle(page), PLAIN[0]) > 20);
    await page.keyboard.press('0');
    near(await middle(page), PLAIN[0], 'colour again');
  });

  test('a view of the address is kept, and a stream without colour has no view of it', async () => {
    const { page } = await open('?src=/files/plain.isv&paused&view=shaded');
    await shows(page, 0);
    assert.equal(await page.locator('#views input:checked').inputValue(), 'shaded');
    const { page: grey } = await open('?src=/files/grey.isv&paused&view=colour');
    await shows(grey, 0);
    assert.equal(await grey.locator('#views input:checked').inputValue(), 'shaded');
    assert.equal(await grey.locator('#views label', { hasText: 'Colour' }).isVisible(), false);
    const has = await grey.evaluate(() => /** @type {any} */ (globalThis).isv.players[0].mesh.geometry.hasAttribute('srgb'));
    assert.equal(has, false);
  });

  test('beside a stream without colour each is seen as it is', async () => {
    const { page, errors } = await open('?src=/files/plain.isv&compare=/files/grey.isv&paused');
    await shows(page, 0, 0);
    await shows(page, 0, 1);
    const views = await page.evaluate(() => /** @type {any} */ (globalThis).isv.views.map((/** @type {any} */ views) => views.view));
    assert.deepEqual(views, ['colour', 'shaded']);
    assert.equal(await page.locator('#views input:checked').inputValue(), 'colour');
    assert.deepEqual(errors, []);
  });

  test('looks as the native picture does', async () => {
    const size = 480;
    const { page } = await open('?src=/files/striped.isv&paused', { width: size, height: size });
    const natives = decodedMeshes(striped);
    for (const [frame, yaw, pitch] of [
      [0, 0, 0],
      [6, 140, 20],
    ]) {
      await page.evaluate((frame) => /** @type {any} */ (globalThis).isv.seek(frame), frame);
      await shows(page, frame);
      const camera = nativeCamera(natives[frame].positions, yaw, pitch);
      const url = await page.evaluate(({ position, target, projection }) => {
        const { stage } = /** @type {any} */ (globalThis).isv;
        stage.grid = false;
        return stage.pictureFrom(position, target, projection);
      }, camera);
      const drawn = parsePng(Buffer.from(url.split(',')[1], 'base64'));
      const native = rendered(striped, frame, size, yaw, pitch, 'colour');
      const mean = meanApart(drawn, native);
      // The program reads colours between vertices, too.
      assert.ok(mean < 4, `frame ${frame}: colours are ${mean} of 255 apart`);
    }
  });

  test('plays round, and frames take their colours into account', async () => {
    const { page, errors } = await open('?src=/files/striped.isv');
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv?.players[0]?.shownFrame >= 5);
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].shownFrame < 3);
    const { bytes, sum } = await page.evaluate(() => {
      const { bytes, positions, normals, colours, indices } = /** @type {any} */ (globalThis).isv.players[0].shown;
      return { bytes, sum: 4 * (positions.length + normals.length + indices.length) + colours.length };
    });
    assert.equal(bytes, sum);
    assert.deepEqual(errors, []);
  });

  test('a live stream is in colour, and says which way is up', async () => {
    const live = await serving(['serve', '--live', '-', '--bind', '127.0.0.1:0']);
    try {
      const { page } = await opened(browser, new URL('/', live.url).href);
      const packets = packetsOf(plain);
      live.stdin.write(Buffer.concat([plain.subarray(0, 48), metadataPacket({ title: 'A ball', up: 'z' }), packets[0]]));
      await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0]?.shown);
      assert.equal(await page.locator('#views input:checked').inputValue(), 'colour');
      await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.firstPictureMs !== null);
      near(await middle(page), PLAIN[0], 'live');
      const said = await page.evaluate(() => {
        const [player] = /** @type {any} */ (globalThis).isv.players;
        return [player.metadata.title, player.up];
      });
      assert.deepEqual(said, ['A ball', 'z']);
    } finally {
      live.close();
    }
  });
});

/** The colour of the picture in the middle of what is looked at, just drawn. @param {import('playwright-core').Page} page @returns {Promise<number[]>} red, green, blue */
function middle(page) {
  return page.evaluate(() => {
    const { stage } = /** @type {any} */ (globalThis).isv;
    const { renderer, camera, controls } = stage;
    stage.stale = true;
    stage.draw();
    const gl = renderer.getContext();
    const { x, y } = controls.target.clone().project(camera);
    const [column, row] = [(x + 1) / 2, (y + 1) / 2].map((part, axis) =>
      Math.floor(part * (axis ? gl.drawingBufferHeight : gl.drawingBufferWidth)),
    );
    const pixel = new Uint8Array(4);
    gl.readPixels(column, row, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    return Array.from(pixel.subarray(0, 3));
  });
}

/** @param {number[]} a @param {number[]} b */
const apart = (a, b) => Math.max(...a.map((value, channel) => Math.abs(value - b[channel])));

/** @param {number[]} found @param {number[]} wanted @param {string} what */
function near(found, wanted, what) {
  assert.ok(apart(found, wanted) <= 2, `${what}: ${found} instead of ${wanted}`);
}

/** Mean difference of colours where both pictures are opaque. @param {import('../support/native.js').Pixels} a @param {import('../support/native.js').Pixels} b */
function meanApart(a, b) {
  let [sum, count] = [0, 0];
  for (let at = 0; at < a.rgba.length; at += 4) {
    if (a.rgba[at + 3] < 255 || b.rgba[at + 3] < 255) continue;
    count += 3;
    for (let channel = 0; channel < 3; channel++) sum += Math.abs(a.rgba[at + channel] - b.rgba[at + channel]);
  }
  return sum / count;
}
