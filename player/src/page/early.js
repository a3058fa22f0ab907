// What takes time and needs no page: runs before three.js is there.

import { anticipate } from '../opening.js';
import { prepare } from '../spawn.js';
import { filesOf, memoryOf, shareOf } from './share.js';

/** How long the page may wait for its decoders, in ms. */
const PATIENCE = 300;

const query = new URLSearchParams(location.search);
const urls = query.has('live') ? [] : filesOf(query);
if (query.has('live')) prepare(1);
// What a file is, its content says; its name says which modules will most likely be needed.
if (urls.some((url) => /\.(mp4|m4v|m3u8)([?#]|$)/i.test(url))) for (const module of ['mp4/take.js', 'sound/sound.js']) import(`../${module}`).catch(() => {});
if (urls.some((url) => /\.m3u8([?#]|$)/i.test(url))) import('../ladder/source.js').catch(() => {});
const anticipated = Promise.all(limited().map((url) => anticipate({ url, ...memoryOf(query), ...shareOf(urls.length) })));

/** The files, or none where the address is wrong, which the page says. */
function limited() {
  try {
    memoryOf(query);
    return urls;
  } catch {
    return [];
  }
}

/**
 * Settles when decoders are at work, or soon. Making a context for drawing keeps this thread for as long as a frame takes to be
 * decoded, and workers cannot start meanwhile: it comes after this.
 */
export const decoding = Promise.race([anticipated, new Promise((wake) => setTimeout(wake, PATIENCE))]);
