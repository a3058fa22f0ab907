// The page in headless Chromium, against what the native program makes of the same stream. Needs `ISV_BIN`.

import assert from 'node:assert/strict';
import { writeFileSync } from 'node:fs';
import { after, before, describe, test } from 'node:test';
import { hasBrowser, launch } from '../support/browser.js';
import {
  ISV_BIN,
  blobStream,
  captureStream,
  decodedMeshes,
  depthStream,
  exported,
  largeStream,
  parsePng,
  rendered,
  sceneStream,
  serving,
  viewed,
} from '../support/native.js';
import { skipUnless } from '../support/need.js';
import { opened, shows, state } from '../support/page.js';
import { serve } from '../support/server.js';
import { packetsOf, repeated } from '../support/stream.js';
import { nativeCamera } from '../support/native-camera.js';

const missing = !hasBrowser ? 'there is no /usr/bin/chromium' : 'ISV_BIN names no program';
const skip = skipUnless(hasBrowser && Boolean(ISV_BIN), 'browser', missing, 'the page');

/** Frames of the take, and of each GOP of the long stream. */
const FRAMES = 12;

describe('the page', { skip }, () => {
  /** @type {import('playwright-core').Browser} */
  let browser;
  /** @type {import('../support/server.js').Served} */
  let server;
  /** @type {Uint8Array} */
  let stream;
  /** @type {ReturnType<typeof decodedMeshes>} */
  let meshes;

  before(async () => {
    stream = blobStream(FRAMES);
    meshes = decodedMeshes(stream);
    browser = await launch();
    server = await serve({
      'blob.isv': stream,
      'long.isv': repeated(stream, 240),
      'text.isv': new Uint8Array(4000).fill(65),
      'damaged.isv': damaged(stream),
    });
  });

  after(async () => {
    await browser?.close();
    await server?.close();
  });

  /** @param {string} query @param {import('../support/page.js').Screen} [screen] */
  const open = (query, screen) => opened(browser, server.url + query, screen);

  /**
   * The shown frame is the native one, vertex for vertex.
   * @param {import('playwright-core').Page} page
   * @param {number} frame
   * @param {number} [player]
   * @param {ReturnType<typeof decodedMeshes>} [natives]
   */
  async function isNative(page, frame, player, natives = meshes) {
    await shows(page, frame, player);
    const { vertices, triangles, drawn, positions } = await state(page, player);
    const native = natives[frame % natives.length];
    assert.deepEqual(
      { vertices, triangles, drawn },
      { vertices: native.vertices, triangles: native.triangles, drawn: native.triangles },
      `frame ${frame}`,
    );
    assert.deepEqual(positions, Array.from(native.positions.subarray(0, 300)), `frame ${frame}`);
  }

  test('a large scene is shown in parts, which frames share', async () => {
    server.files.set('scene.isv', sceneStream(4));
    const { page, errors } = await open('?src=files/scene.isv&paused');
    const look = () =>
      page.evaluate(() => {
        const { shown, mesh, ahead } = /** @type {any} */ (globalThis).isv.players[0];
        const { drawn } = mesh.geometry;
        let real = 0;
        for (let at = 0; at < drawn.length; at += 3)
          real += Number(drawn[at] !== drawn[at + 1] && drawn[at + 1] !== drawn[at + 2] && drawn[at + 2] !== drawn[at]);
        const { parts, triangles, bounds } = shown;
        return { parts: parts?.size ?? 0, triangles, real, bounds, bytes: ahead.bytes, held: ahead.held };
      });
    await shows(page, 0);
    const first = await look();
    assert.ok(first.parts > 100 && first.real === first.triangles && first.triangles > 1_000_000, JSON.stringify(first));
    for (const frame of [3, 1, 2]) {
      await page.evaluate((frame) => /** @type {any} */ (globalThis).isv.players[0].seek(frame), frame);
      await shows(page, frame);
    }
    const last = await look();
    assert.ok(last.real === last.triangles && last.held === 4, JSON.stringify(last));
    assert.ok(last.bytes < 1.5 * first.bytes, 'the floor is in memory once');
    // Views of blocks take whole surfaces, which are the same.
    await page.evaluate(() => (/** @type {any} */ (globalThis).isv.players[0].details = true));
    const whole = () => /** @type {any} */ (globalThis).isv.players[0].shown?.parts === null;
    await page.waitForFunction(whole, undefined, { timeout: 60_000, polling: 20 });
    const { triangles, bounds, parts, real } = await look();
    assert.deepEqual({ triangles, bounds, parts, real }, { triangles: last.triangles, bounds: last.bounds, parts: 0, real: last.real });
    assert.deepEqual(errors, []);
  });

  test('plays', async () => {
    const { page, errors } = await open('?src=/files/blob.isv');
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv?.players[0]?.shownFrame >= 3);
    // And goes round.
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].shownFrame < 3);
    assert.equal((await state(page)).playing, true);
    assert.deepEqual(errors, []);
  });

  test('every frame is the native one', async () => {
    const { page } = await open('?src=/files/blob.isv&paused');
    for (let frame = 0; frame < FRAMES; frame++) {
      await isNative(page, frame);
      await page.keyboard.press('ArrowRight');
    }
    await isNative(page, 0);
  });

  test('is the same from the program itself', async () => {
    const served = await viewed([stream, stream]);
    try {
      const { page, errors } = await opened(browser, served.url);
      await page.waitForFunction(() => /** @type {any} */ (globalThis).isv?.players[1]?.shown);
      await page.evaluate(() => /** @type {any} */ (globalThis).isv.toggle());
      await page.evaluate(() => /** @type {any} */ (globalThis).isv.seek(5));
      await isNative(page, 5, 0);
      await isNative(page, 5, 1);
      assert.deepEqual(errors, []);
    } finally {
      served.close();
    }
  });

  test('looks as the native picture does', async () => {
    const size = 480;
    const { page } = await open('?src=/files/blob.isv&paused&view=normals', { width: size, height: size });
    for (const [frame, yaw, pitch] of [
      [0, 0, 0],
      [7, 140, 20],
    ]) {
      await page.evaluate((frame) => /** @type {any} */ (globalThis).isv.seek(frame), frame);
      await isNative(page, frame);
      const camera = nativeCamera(meshes[frame].positions, yaw, pitch);
      const drawn = parsePng(await pictureOnly(page, camera));
      looksLike(drawn, rendered(stream, frame, size, yaw, pitch), `frame ${frame}`);
    }
  });

  test('plays a capture, and shows it as the native picture does', async (context) => {
    const frames = 6;
    const capture = captureStream('dancer', frames);
    const why = skipUnless(Boolean(capture), 'captures', 'ISV_DATA names no folder that has dancer', context.name);
    if (!capture) return context.skip(why || '');
    const natives = decodedMeshes(capture);
    server.files.set('dancer.isv', capture);
    const size = 480;
    const { page, errors } = await open('?src=/files/dancer.isv&view=normals', { width: size, height: size });
    await page.waitForFunction((last) => /** @type {any} */ (globalThis).isv.players[0].shownFrame === last, frames - 1, { polling: 5 });
    await page.evaluate(() => /** @type {any} */ (globalThis).isv.toggle());
    for (const frame of [4, 1]) {
      await page.evaluate((frame) => /** @type {any} */ (globalThis).isv.seek(frame), frame);
      await isNative(page, frame, 0, natives);
    }
    const drawn = parsePng(await pictureOnly(page, nativeCamera(natives[1].positions, 30, 10)));
    looksLike(drawn, rendered(capture, 1, size, 30, 10), 'dancer');
    assert.deepEqual(errors, []);
  });

  test('seeks, steps and goes to the ends', async () => {
    const { page } = await open('?src=/files/long.isv&paused');
    await isNative(page, 0);
    for (const frame of [131, 12, 11, 239, 60]) {
      await page.locator('#frame').fill(String(frame));
      await page.locator('#frame').press('Enter');
      await isNative(page, frame);
    }
    await page.locator('#canvas').focus();
    for (const [key, frame] of /** @type {[string, number][]} */ ([
      ['ArrowLeft', 59],
      ['ArrowLeft', 58],
      ['Shift+ArrowRight', 68],
      ['End', 239],
      ['ArrowRight', 0],
      ['ArrowLeft', 239],
      ['Home', 0],
    ])) {
      await page.keyboard.press(key);
      await isNative(page, frame);
    }
  });

  test('a drag on the scrub bar ends on its frame', async () => {
    const { page } = await open('?src=/files/long.isv&paused');
    await shows(page, 0);
    const box = await page.locator('#position').boundingBox();
    assert.ok(box);
    const x = (/** @type {number} */ part) => box.x + 7 + (box.width - 14) * part;
    const y = box.y + box.height / 2;
    await page.mouse.move(x(0), y);
    await page.mouse.down();
    await page.mouse.move(x(0.9), y, { steps: 30 });
    await page.mouse.move(x(0.4), y, { steps: 30 });
    await page.mouse.up();
    const { frame } = await state(page);
    assert.ok(Math.abs(frame - 0.4 * 239) <= 2, `${frame}`);
    await isNative(page, frame);
  });

  test('keys and buttons control it', async () => {
    const { page } = await open('?src=/files/long.isv&paused');
    await shows(page, 0);
    await page.keyboard.press(' ');
    assert.equal((await state(page)).playing, true);
    await page.getByRole('button', { name: 'Pause' }).click();
    assert.equal((await state(page)).playing, false);
    await page.locator('#canvas').focus();
    await page.keyboard.press('2');
    assert.equal(await page.locator('#views input:checked').inputValue(), 'normals');
    await page.keyboard.press('l');
    await page.locator('[data-do=loop][aria-pressed=false]').waitFor();
    await page.keyboard.press(']');
    assert.equal(await page.locator('#speed').inputValue(), '2');
    const camera = () => page.evaluate(() => /** @type {any} */ (globalThis).isv.stage.camera.position.toArray());
    const before = await camera();
    await page.keyboard.press('d');
    assert.notDeepEqual(await camera(), before);
    await page.keyboard.press('?');
    assert.ok(await page.getByRole('dialog').isVisible());
    assert.match((await page.getByRole('dialog').textContent()) ?? '', /play or pause/);
    await page.keyboard.press('Escape');
    assert.equal(await page.getByRole('dialog').isVisible(), false);
  });

  test('everything can be reached by Tab and has a name', async () => {
    const { page } = await open('?src=/files/blob.isv&paused');
    await shows(page, 0);
    const controls = page.locator('button:visible, select:visible, input:visible');
    const nameless = await controls.evaluateAll((all) =>
      all
        .filter(
          (one) =>
            !one.getAttribute('aria-label') &&
            !(/** @type {HTMLInputElement} */ (one).labels?.[0]?.textContent?.trim()) &&
            !one.textContent?.trim(),
        )
        .map((one) => one.outerHTML),
    );
    assert.deepEqual(nameless, []);
    const reached = new Set();
    for (let presses = 0; presses < 25; presses++) {
      await page.keyboard.press('Tab');
      reached.add(
        await page.evaluate(() => document.activeElement?.id || /** @type {HTMLElement} */ (document.activeElement)?.dataset.do),
      );
    }
    for (const id of ['canvas', 'position', 'play', 'speed', 'frame', 'help'])
      assert.ok(reached.has(id), `Tab reaches ${id}: ${[...reached]}`);
  });

  test('two files go side by side, with one clock and one camera', async () => {
    const { page, errors } = await open('?src=/files/blob.isv&compare=/files/long.isv&paused');
    await isNative(page, 0, 0);
    await isNative(page, 0, 1);
    await page.keyboard.press('ArrowRight');
    await page.keyboard.press('ArrowRight');
    await isNative(page, 2, 0);
    await isNative(page, 2, 1);
    await page.keyboard.press('End');
    await isNative(page, FRAMES - 1, 0);
    await isNative(page, FRAMES - 1, 1);
    assert.equal(await page.locator('#cards article').count(), 2);
    assert.deepEqual(errors, []);
  });

  test('a file of this device is opened', async () => {
    const { page } = await open('');
    assert.ok(await page.getByRole('heading', { name: 'isv player' }).isVisible());
    await page.locator('#file').setInputFiles({ name: 'mine.isv', mimeType: '', buffer: Buffer.from(stream) });
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0]?.shown);
    assert.match((await page.locator('#cards').textContent()) ?? '', /mine\.isv/);
  });

  test('what cannot be played is said in words', async () => {
    for (const [query, words] of /** @type {[string, RegExp][]} */ ([
      ['?src=/files/none.isv', /no such file/],
      ['?src=/files/text.isv', /text\.isv is no \.isv file/],
    ])) {
      const { page } = await open(query);
      await page.getByRole('alert').waitFor();
      assert.match((await page.getByRole('alert').textContent()) ?? '', words);
    }
  });

  test('a missing decoder is said in words', async () => {
    server.habits.missing.add('/src/isv.wasm');
    const { page } = await open('?src=/files/blob.isv');
    await page
      .getByRole('alert')
      .waitFor()
      .finally(() => server.habits.missing.clear());
    assert.match((await page.getByRole('alert').textContent()) ?? '', /decoder cannot be loaded/);
  });

  test('a damaged frame is said, and playing goes on at the next keyframe', async () => {
    const { page } = await open('?src=/files/damaged.isv');
    const message = page.locator('#messages', { hasText: 'frame 15 is damaged' });
    await message.waitFor();
    assert.match((await message.textContent()) ?? '', /goes on at frame 24/);
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].shownFrame >= 24);
    await page.evaluate(() => /** @type {any} */ (globalThis).isv.toggle());
    await page.evaluate(() => /** @type {any} */ (globalThis).isv.seek(26));
    await isNative(page, 26);
  });

  test('a frame that needs more memory than it is given is refused for as long as it is there', async () => {
    const { page } = await open('?src=/files/blob.isv&max-memory=100kB');
    const alert = page.getByRole('alert').filter({ hasText: 'frame 0' });
    await alert.waitFor();
    const words = (await alert.textContent()) ?? '';
    assert.match(words, /frame 0 needs [\d,]+ blocks, about [\d.]+ [MG]B, and the player was given 100 kB: isv view --max-memory [\d.]+GB/);
    assert.doesNotMatch(words, /damaged/);
    // Longer than a passing message stays.
    await page.waitForTimeout(6500);
    assert.ok(await alert.isVisible());
    const { playing, frame } = await state(page);
    assert.deepEqual({ playing, frame }, { playing: false, frame: 0 });
    assert.doesNotMatch((await page.locator('#messages').textContent()) ?? '', /damaged/);
  });

  test('an amount of memory that is none is said in words', async () => {
    const { page } = await open('?src=/files/blob.isv&max-memory=lots');
    await page.getByRole('alert').filter({ hasText: 'max-memory=lots is no amount of memory' }).waitFor();
  });

  test('a file of which nothing can be decoded is called so, and the playhead stands still', async () => {
    const broken = Uint8Array.from(stream);
    for (const packet of packetsOf(broken)) packet[packet.length - 5] ^= 16;
    server.files.set('broken.isv', broken);
    const { page } = await open('?src=/files/broken.isv');
    await page.getByRole('alert').filter({ hasText: 'no frame of it can be decoded' }).waitFor();
    assert.equal((await state(page)).playing, false);
  });

  test('a frame of more than 131,072 blocks is shown', async () => {
    server.files.set('large.isv', largeStream());
    const { page, errors } = await open('?src=/files/large.isv&paused');
    await shows(page, 0);
    const { triangles } = await state(page);
    assert.ok(triangles > 4_000_000, `${triangles} triangles`);
    assert.deepEqual(errors, []);
    server.files.delete('large.isv');
  });

  test('a depth take is seen from where its camera stood, and from behind in another tint', async () => {
    server.files.set('depth.isv', depthStream());
    const { page, errors } = await open('?src=/files/depth.isv&paused&up=-y');
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.firstPictureMs !== null);
    await page.locator('#legend', { hasText: 'back of the surface' }).waitFor();
    const towards = await page.evaluate(() => {
      const { camera, controls } = /** @type {any} */ (globalThis).isv.stage;
      return camera.position.clone().sub(controls.target).normalize().toArray();
    });
    assert.ok(towards[2] > 0.95, `-z of the capture is z where -y is up: ${towards}`);
    assert.ok(!isReddish(await middle(page)), 'the front');
    await page.evaluate(() => /** @type {any} */ (globalThis).isv.stage.turn(Math.PI, 0));
    await page.waitForFunction(() => !(/** @type {any} */ (globalThis).isv.stage.stale));
    assert.ok(isReddish(await middle(page)), 'the back is drawn, and is not taken for the front');
    assert.deepEqual(errors, []);
    await page.keyboard.press('2');
    await page.locator('#legend', { hasText: 'back of the surface' }).waitFor();
  });

  test('a closed surface is seen from in front, and needs no words for its back', async () => {
    const { page } = await open('?src=/files/blob.isv&paused');
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.firstPictureMs !== null);
    assert.equal(await page.locator('#legend').isVisible(), false);
    const z = await page.evaluate(() => {
      const { camera, controls } = /** @type {any} */ (globalThis).isv.stage;
      return camera.position.z - controls.target.z;
    });
    assert.ok(z > 0);
  });

  test('any axis can be up', async () => {
    const { page } = await open('?src=/files/blob.isv&paused&up=z');
    await shows(page, 0);
    const seen = [];
    for (let presses = 0; presses < 7; presses++) {
      seen.push(await page.evaluate(() => /** @type {any} */ (globalThis).isv.stage.up));
      await page.keyboard.press('u');
    }
    assert.deepEqual(seen, ['z', '-y', '-z', 'x', '-x', 'y', 'z']);
    const up = await page.evaluate(() => {
      const { stage, players } = /** @type {any} */ (globalThis).isv;
      const box = players[0].mesh.geometry.boundingBox.clone();
      players[0].object.updateMatrixWorld(true);
      return { up: stage.up, turned: box.applyMatrix4(players[0].mesh.matrixWorld).max.y, box: -players[0].mesh.geometry.boundingBox.min.y };
    });
    assert.equal(up.up, '-y');
    await page.locator('#up', { hasText: '\u2212Y' }).waitFor();
    await page.keyboard.press('Shift+U');
    await page.locator('#up', { hasText: 'Z' }).waitFor();
    assert.ok(Math.abs(up.turned - up.box) < 1e-5, 'what is lowest in the capture is on top');
  });

  test('the address of the program alone offers what it serves', async () => {
    const files = await Promise.all([stream, stream].map(async (bytes, at) => {
      const path = `${process.env.TMPDIR ?? '/tmp'}/isv-offer-${process.pid}-${at}.isv`;
      writeFileSync(path, bytes);
      return path;
    }));
    const served = await serving(['serve', ...files, '--bind', '127.0.0.1:0', '--up', 'z', '--max-memory', '1GiB']);
    try {
      const { page, errors } = await opened(browser, new URL('/', served.url).href);
      const links = page.locator('#streams a');
      await links.nth(1).waitFor();
      assert.equal(await links.count(), 2);
      await links.nth(1).click();
      await shows(page, 0);
      const { up, name } = await page.evaluate(() => {
        const { stage, players } = /** @type {any} */ (globalThis).isv;
        return { up: stage.up, name: players[0].source.name };
      });
      assert.equal(up, 'z');
      assert.match(name, /isv-offer-\d+-1\.isv/);
      assert.deepEqual(errors, []);
    } finally {
      served.close();
    }
  });

  test('from a disk it says that it needs a web server', async () => {
    await exported(stream, async (folder) => {
      const context = await browser.newContext();
      const page = await context.newPage();
      await page.goto(`file://${folder}/index.html`);
      const words = page.getByRole('alert').filter({ hasText: 'needs a web server' });
      await words.waitFor();
      assert.match((await words.textContent()) ?? '', /python3 -m http\.server/);
      assert.equal(await page.locator('#foot').isVisible(), false);
      await context.close();
    });
  });

  test('modules of a wrong type are said in words', async () => {
    const context = await browser.newContext();
    const page = await context.newPage();
    await page.route('**/*.js', async (route) => {
      const response = await route.fetch();
      await route.fulfill({ response, headers: { ...response.headers(), 'content-type': 'text/plain' } });
    });
    await page.goto(`${server.url}?src=/files/blob.isv`);
    await page.getByRole('alert').filter({ hasText: 'needs a web server' }).waitFor();
    await context.close();
  });

  test('a browser without WebGL is said in words', async () => {
    const context = await browser.newContext();
    const page = await context.newPage();
    await page.addInitScript(() => {
      HTMLCanvasElement.prototype.getContext = () => null;
    });
    await page.goto(`${server.url}?src=/files/blob.isv`);
    await page.getByRole('alert').waitFor();
    assert.match((await page.getByRole('alert').textContent()) ?? '', /WebGL/);
  });

  test('it stays within its memory, and buffers are not made anew for each frame', async () => {
    const { page } = await open('?src=/files/long.isv');
    await page.evaluate(() => {
      const page = /** @type {any} */ (globalThis).isv;
      page.clock.speed = 4;
    });
    await page.waitForFunction(() => /** @type {any} */ (globalThis).isv.players[0].shownFrame > 60);
    const { bytes, budget, reallocations } = await page.evaluate(() => {
      const { ahead, mesh } = /** @type {any} */ (globalThis).isv.players[0];
      return { bytes: ahead.bytes, budget: ahead.budget, reallocations: mesh.geometry.reallocations };
    });
    assert.ok(bytes <= budget, `${bytes} of ${budget}`);
    assert.ok(reallocations <= 3, `${reallocations}`);
  });

  test('fingers turn, zoom and tap on a phone, and decoded frames take less memory there', async () => {
    const { page, errors } = await open('?src=/files/blob.isv&paused', { width: 390, height: 844, touch: true });
    await shows(page, 0);
    const touches = await page.context().newCDPSession(page);
    const camera = () =>
      page.evaluate(() => {
        const { camera, controls } = /** @type {any} */ (globalThis).isv.stage;
        const arm = camera.position.clone().sub(controls.target);
        return { heading: Math.atan2(arm.x, arm.z), distance: arm.length() };
      });
    /** @param {{ x: number, y: number }[][]} path points of each finger, one after the other */
    const touch = async (path) => {
      const at = (/** @type {number} */ step) => path.map((points, id) => ({ ...points[step], id }));
      await touches.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: at(0) });
      for (let step = 1; step < path[0].length; step++) await touches.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: at(step) });
      await touches.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
      await page.waitForTimeout(300);
    };
    const line = (/** @type {number} */ from, /** @type {number} */ to) => Array.from({ length: 9 }, (_, at) => ({ x: from + ((to - from) * at) / 8, y: 350 }));
    const first = await camera();
    await touch([line(150, 250)]);
    const turned = await camera();
    assert.ok(Math.abs(turned.heading - first.heading) > 0.1, 'one finger turns');
    await touch([line(180, 90), line(210, 300)]);
    assert.ok((await camera()).distance < 0.8 * turned.distance, 'two fingers zoom');
    await page.getByRole('button', { name: 'Play' }).tap();
    assert.equal((await state(page)).playing, true);
    await page.getByRole('button', { name: 'Pause' }).tap();
    const box = await page.locator('#position').boundingBox();
    assert.ok(box);
    await page.touchscreen.tap(box.x + 7 + ((box.width - 14) * 6) / (FRAMES - 1), box.y + box.height / 2);
    await isNative(page, 6);
    const { budget, workers } = await page.evaluate(() => {
      const { budget, workers } = /** @type {any} */ (globalThis).isv.players[0].ahead;
      return { budget, workers };
    });
    assert.ok(budget <= 64 << 20 && workers <= 2, `${budget} bytes, ${workers} workers`);
    assert.deepEqual(errors, []);
  });

  test('fits a phone: nothing is wider than the screen', async () => {
    const { page } = await open('?src=/files/blob.isv&paused&view=normals', { width: 360, height: 740, touch: true });
    await shows(page, 0);
    const wide = await page.evaluate(() =>
      [...document.querySelectorAll('#transport *, #cards *, #legend *')]
        .filter((one) => one.getBoundingClientRect().right > innerWidth + 1)
        .map((one) => one.outerHTML.slice(0, 80)),
    );
    assert.deepEqual(wide, []);
  });
});

/** Three GOPs, the second with a byte turned in a frame. @param {Uint8Array} stream */
function damaged(stream) {
  const long = Uint8Array.from(repeated(stream, 3 * FRAMES));
  const packet = packetsOf(long)[FRAMES + 3];
  packet[packet.length - 5] ^= 16;
  return long;
}

/** The colour in the middle of the picture. @param {import('playwright-core').Page} page @returns {Promise<number[]>} red, green, blue */
async function middle(page) {
  const box = await page.locator('#canvas').boundingBox();
  const { x, y } = await page.evaluate(() => {
    const { camera, controls } = /** @type {any} */ (globalThis).isv.stage;
    const { x, y } = controls.target.clone().project(camera);
    return { x: (x + 1) / 2, y: (1 - y) / 2 };
  });
  assert.ok(box);
  const clip = { x: Math.round(box.x + x * box.width), y: Math.round(box.y + y * box.height), width: 1, height: 1 };
  return Array.from(parsePng(await page.screenshot({ clip })).rgba.subarray(0, 3));
}

/** @param {number[]} colour */
function isReddish([red, , blue]) {
  return red - blue > 25;
}

/** The picture alone, from a camera. @param {import('playwright-core').Page} page @param {{ position: number[], target: number[], projection: number[] }} camera */
async function pictureOnly(page, camera) {
  const url = await page.evaluate(({ position, target, projection }) => {
    const { stage } = /** @type {any} */ (globalThis).isv;
    stage.grid = false;
    return stage.pictureFrom(position, target, projection);
  }, camera);
  return Buffer.from(url.split(',')[1], 'base64');
}

/** @param {import('../support/native.js').Pixels} drawn @param {import('../support/native.js').Pixels} native @param {string} what */
function looksLike(drawn, native, what) {
  const { overlap, colour } = compared(drawn, native);
  assert.ok(overlap > 0.985, `${what}: silhouettes overlap by ${overlap}`);
  assert.ok(colour < 12, `${what}: colours are ${colour} of 255 apart`);
}

/** How much two silhouettes overlap, and how far colours are apart where both are opaque. @param {import('../support/native.js').Pixels} a @param {import('../support/native.js').Pixels} b */
function compared(a, b) {
  let both = 0;
  let either = 0;
  let apart = 0;
  for (let at = 0; at < a.rgba.length; at += 4) {
    const [inA, inB] = [a.rgba[at + 3] > 127, b.rgba[at + 3] > 127];
    both += Number(inA && inB);
    either += Number(inA || inB);
    if (inA && inB) for (let c = 0; c < 3; c++) apart += Math.abs(a.rgba[at + c] - b.rgba[at + c]) / 3;
  }
  return { overlap: both / either, colour: apart / both };
}
