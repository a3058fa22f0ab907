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
};

/**
 * @typedef {object} Served
 * @property {string} url where the page is
 * @property {Map<string, Uint8Array>} files what is served under `/files/`, by name; may change
 * @property {{ path: string, range: string | undefined }[]} requests
 * @property {{ ranges: boolean, delayMs: number, missing: Set<string> }} habits whether ranges are heeded, and paths that are not found
 * @property {() => Promise<void>} close
 */

/** Serves the player's folder and some files. @param {Record<string, Uint8Array>} [files] @returns {Promise<Served>} */
export async function serve(files = {}) {
  /** @type {Omit<Served, 'url' | 'close'>} */
  const served = {
    files: new Map(Object.entries(files)),
    requests: [],
    habits: { ranges: true, delayMs: 0, missing: new Set() },
  };
  const server = createServer(async (request, response) => {
    const path = decodeURIComponent((request.url ?? '/').split('?')[0]);
    served.requests.push({ path, range: request.headers.range });
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
    if (!range) return response.writeHead(200, { ...headers, 'content-length': bytes.length }).end(bytes);
    const [from, to] = range;
    if (from >= bytes.length) return response.writeHead(416, { 'content-range': `bytes */${bytes.length}` }).end();
    const part = bytes.subarray(from, to);
    headers['content-range'] = `bytes ${from}-${to - 1}/${bytes.length}`;
    response.writeHead(206, { ...headers, 'content-length': part.length }).end(part);
  });
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
