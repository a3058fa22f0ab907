// A file opened, and its first frame on the way: needs no page and no three.js, so that both can load meanwhile.

import { allowanceFor, allowanceOf } from './allowance.js';
import { IsvFailure } from './failure.js';
import { BlobBytes, HttpBytes } from './ranges.js';
import { openSource } from './source.js';
import { compileDecoder, spawnWorker } from './spawn.js';
import { Decoder } from './wasm.js';
import { DecodeAhead } from './workers.js';

/** Bytes of decoded frames held, unless said otherwise: about three seconds of a person at 5 mm, and more of what is smaller. */
const MEMORY = 256 << 20;

/**
 * Which file, and what decoding it may take.
 * @typedef {Pick<import('./player.js').PlayerOptions, 'url' | 'source' | 'wasm' | 'workers' | 'memory' | 'maxMemory' | 'voxels'> & { signal?: AbortSignal }} FileOptions signal: nobody waits for it any more
 */

/** Opens a file. Nothing is decoded before `start`. @param {FileOptions} options @returns {Promise<DecodeAhead>} */
async function open(options) {
  const module = compileDecoder(options.wasm);
  const cores = globalThis.navigator?.hardwareConcurrency || 2;
  const workers = Math.max(1, options.workers ?? Math.min(cores, 4));
  // Their scripts load while the file is opened.
  const ports = Array.from({ length: workers }, spawnWorker);
  const parser = module.then((module) => Decoder.create(module));
  parser.catch(() => {}); // Said below, unless the file fails first.
  try {
    const bytes = bytesOf(options);
    options.signal?.addEventListener('abort', () => bytes.close(), { once: true });
    const source = await openSource(bytes, parser);
    const { memory = MEMORY } = options;
    const allowance = allowanceFor(allowanceOf(options), { colour: source.facts.some(({ colour }) => colour) });
    const spawn = () => ports.pop() ?? spawnWorker();
    return new DecodeAhead({ source, module: await module, spawn, workers, budget: memory, allowance });
  } finally {
    for (const port of ports) port.terminate();
  }
}

/** Files that were opened before their players were there. @type {Map<string, Promise<DecodeAhead>>} by address */
const anticipated = new Map();

/**
 * Opens a file and decodes its first frame before there is a player, which takes over.
 * @param {FileOptions & { url: string }} options
 * @returns {Promise<void>} settles when that is being done, or cannot be
 */
export function anticipate(options) {
  // The same file beside itself: the second player opens it.
  if (anticipated.has(options.url)) return Promise.resolve();
  const opening = open(options).then((ahead) => {
    ahead.hurry();
    ahead.start();
    return ahead;
  });
  anticipated.set(options.url, opening);
  // What goes wrong is said by the player.
  return opening.then((ahead) => ahead.begun).catch(() => {});
}

/** Opens a file, or takes over one that has been. @param {FileOptions} options @returns {Promise<DecodeAhead>} */
export function openFile(options) {
  const opening = options.url === undefined ? undefined : anticipated.get(options.url);
  if (!opening || options.url === undefined) return open(options);
  anticipated.delete(options.url);
  return opening;
}

/** @param {FileOptions} options */
function bytesOf({ url, source }) {
  if (source instanceof Blob) return new BlobBytes(source);
  if (source) return new BlobBytes(new Blob([/** @type {ArrayBuffer} */ (source)]));
  if (url !== undefined) return new HttpBytes(url);
  throw new IsvFailure('missing', 'there is nothing to play: give a url, a source or a live stream');
}
