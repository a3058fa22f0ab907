// A server of files for tests: ranges, ETags, and what servers do badly.

import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import { extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';

/** The folder of the player. */
export const PLAYER = fileURLToPath(new URL('../..', import.meta.url));

/** @type {Record<string, string>} */
const TYPES = {
  '.html': 'text/html',
  '.css': 'text/css',
  '.js': 'text/javascript',
  '.wasm': 'application/wasm',
  '.isv': 'application/octet-stream',
  '.mp4': 'video/mp4',
  '.m4s': 'video/iso.segment',
  '.m3u8': 'application/vnd.apple.mpegurl',
};

/**
 * @typedef {object} Served
 * @property {string} url where the page is
 * @property {Map<string, Uint8Array>} files what is served under `/files/`, by name; may change
 * @property {{ path: string, range: string | undefined }[]} requests
 * @property {{ ranges: boolean, delayMs: number, missing: Set<string>, refused: Set<string>, silent: Set<string>, rate: number }} habits whether
 *   ranges are heeded, paths that are not found, whose connections are closed, and that are never answered; bytes a second of all that is
 *   under `/files/`, 0 for as many as it takes
 * @property {() => Promise<void>} close
 */

/** Serves the player's folder and some files. @param {Record<string, Uint8Array>} [files] @returns {Promise<Served>} */
export async function serve(files = {}) {
  /** @type {Omit<Served, 'url' | 'close'>} */
  const served = {
    files: new Map(Object.entries(files)),
    requests: [],
    habits: { ranges: true, delayMs: 0, missing: new Set(), refused: new Set(), silent: new Set(), rate: 0 },
  };
  const server = createServer(async (request, response) => {
    const path = decodeURIComponent((request.url ?? '/').split('?')[0]);
    served.requests.push({ path, range: request.headers.range });
    if (served.habits.silent.has(path)) return;
    if (served.habits.refused.has(path)) return request.socket.destroy();
    const bytes = served.habits.missing.has(path) ? null : await contentOf(served.files, path);
    if (path.startsWith('/files/') && served.habits.delayMs) await new Promise((wake) => setTimeout(wake, served.habits.delayMs));
    if (!bytes) return response.writeHead(404).end();
    /** @type {Record<string, string>} */
    const headers = {
      'content-type': TYPES[extname(path === '/' ? 'index.html' : path)] ?? 'application/octet-stream',
      etag: `"${bytes.length}"`,
      'cache-control': 'no-store',
    };
    const range = served.habits.ranges ? rangeOf(request.headers.range, bytes.length) : null;
    const send = path.startsWith('/files/') ? trickle : (/** @type {typeof response} */ to, /** @type {Uint8Array} */ all) => to.end(all);
    if (!range) return send(response.writeHead(200, { ...headers, 'content-length': bytes.length }), bytes);
    const [from, to] = range;
    if (from >= bytes.length) return response.writeHead(416, { 'content-range': `bytes */${bytes.length}` }).end();
    const part = bytes.subarray(from, to);
    headers['content-range'] = `bytes ${from}-${to - 1}/${bytes.length}`;
    send(response.writeHead(206, { ...headers, 'content-length': part.length }), part);
  });
  /** When the line is free again, in ms. */
  let free = 0;
  /** Sends bytes as slowly as they come over a line that all requests share. @param {import('node:http').ServerResponse} response @param {Uint8Array} bytes */
  async function trickle(response, bytes) {
    free = Math.max(free, performance.now());
    for (let at = 0; at < bytes.length && !response.destroyed; ) {
      const { rate } = served.habits;
      if (!rate) {
        response.write(bytes.subarray(at));
        break;
      }
      const part = bytes.subarray(at, at + Math.max(256, Math.floor(rate / 50)));
      free += (1000 * part.length) / rate;
      const wait = free - performance.now();
      await new Promise((wake) => setTimeout(wake, wait));
      response.write(part);
      at += part.length;
    }
    response.end();
  }
  await new Promise((listening) => server.listen(0, '127.0.0.1', () => listening(undefined)));
  const { port } = /** @type {import('node:net').AddressInfo} */ (server.address());
  const close = () =>
    new Promise((/** @type {(value: void) => void} */ closed) => {
      server.closeAllConnections();
      server.close(() => closed());
    });
  return { ...served, url: `http://127.0.0.1:${port}/`, close };
}

/** @param {Map<string, Uint8Array>} files @param {string} path */
async function contentOf(files, path) {
  if (path.startsWith('/files/')) return files.get(path.slice('/files/'.length)) ?? null;
  const file = normalize(path === '/' ? '/index.html' : path);
  return readFile(join(PLAYER, file)).catch(() => null);
}

/** First byte and the one after the last. @param {string | undefined} header @param {number} length @returns {[number, number] | null} */
function rangeOf(header, length) {
  const match = /^bytes=(\d*)-(\d*)$/.exec(header ?? '');
  if (!match) return null;
  if (match[1] === '') return [Math.max(0, length - Number(match[2])), length];
  return [Number(match[1]), match[2] === '' ? length : Math.min(length, Number(match[2]) + 1)];
}
