// The decoder's module and the workers it runs in.

import { IsvFailure, words } from './failure.js';

/** @type {Map<string, Promise<WebAssembly.Module>>} by address */
const compiled = new Map();

/**
 * Compiles the decoder while it loads, once for all players.
 * @param {string | URL | WebAssembly.Module} [wasm] where it is, or itself
 * @returns {Promise<WebAssembly.Module>}
 */
export function compileDecoder(wasm = new URL('./isv.wasm', import.meta.url)) {
  if (typeof WebAssembly !== 'object') return Promise.reject(new IsvFailure('unsupported', 'this browser has no WebAssembly'));
  if (wasm instanceof WebAssembly.Module) return Promise.resolve(wasm);
  const url = String(wasm);
  let module = compiled.get(url);
  if (!module) {
    module = compile(url);
    compiled.set(url, module);
    module.catch(() => compiled.delete(url));
  }
  return module;
}

/** @param {string} url */
async function compile(url) {
  try {
    const response = await fetch(url);
    if (!response.ok) throw new Error(`the server says ${response.status} ${response.statusText}`.trim());
    // Some servers do not know the type of wasm files, without which nothing is compiled as it comes.
    const typed = response.headers.get('content-type')?.startsWith('application/wasm');
    return await (typed ? WebAssembly.compileStreaming(response) : WebAssembly.compile(await response.arrayBuffer()));
  } catch (cause) {
    throw new IsvFailure('unsupported', `the decoder cannot be loaded from ${url}: ${words(cause)}`, { cause });
  }
}

/** Starts a worker. @returns {import('./lane.js').Port} */
export function spawnWorker() {
  return /** @type {import('./lane.js').Port} */ (new Worker(new URL('./worker.js', import.meta.url), { type: 'module' }));
}
