// Takes a picture of the page in Chromium:
//
//   node player/bench/picture.js OUT.png FRAME VIEW STREAM.isv [OTHER.isv]
//
// `docs/images/player.png` is of the demo's figure, beside the same coded again at a lower quality:
//
//   isv demo -o demo && isv encode demo/figure.isv -o demo/coarse.isv --quality 10 --colour-quality 10
//   node player/bench/picture.js docs/images/player.png 12 colour demo/figure.isv demo/coarse.isv
//
// Figures of the streams are hidden: times would be those of this machine and of its other work.

import { readFileSync } from 'node:fs';
import { basename } from 'node:path';
import { launch } from '../test/support/browser.js';
import { opened, shows } from '../test/support/page.js';
import { serve } from '../test/support/server.js';

const [out, frame, view, ...paths] = process.argv.slice(2);
if (!paths.length) throw new Error('node bench/picture.js OUT.png FRAME VIEW STREAM.isv [OTHER.isv]');
const server = await serve(Object.fromEntries(paths.map((path) => [basename(path), new Uint8Array(readFileSync(path))])));
const browser = await launch();
const query = paths.map((path, at) => `${at ? 'compare' : 'src'}=/files/${basename(path)}`).join('&');
const { page } = await opened(browser, `${server.url}?${query}&paused&view=${view}`, { width: 1600, height: 720 });
await page.evaluate((frame) => /** @type {any} */ (globalThis).isv.seek(frame), Number(frame));
for (let player = 0; player < paths.length; player++) await shows(page, Number(frame), player);
await page.keyboard.press('i');
// The camera comes to rest, and the frames ahead are decoded.
await page.waitForTimeout(6000);
await page.screenshot({ path: out });
await browser.close();
await server.close();
