// A Web Worker with one decoder. It takes packets in order, decodes them one a turn, so that a `cancel` between two of them
// is heard at once, and sends back meshes whose arrays are transferred.

import { Decoder, IsvError } from './wasm.js';
import { bitsOfVertices } from './block-bits.js';
import { boundsOf, boundsOfParts } from './bounds.js';
import { words } from './failure.js';

/**
 * What a worker is told. `start` comes first. `decode`: `run` is a number that comes back with the answer; `surface` false only
 * moves the decoder on. `cancel` forgets what waits.
 * @typedef {{ do: 'start', module: WebAssembly.Module, header: Uint8Array, allowance?: import('./allowance.js').Allowance }} Start
 * @typedef {object} Decode
 * @property {'decode'} do
 * @property {number} run
 * @property {number} frame
 * @property {Uint8Array} packet
 * @property {number} at where the packet begins in the stream
 * @property {boolean} surface
 * @property {boolean} details
 * @property {number} stream which of the take's streams the packet is of
 * @property {Uint8Array} [header] of that stream, if the packet before was of another
 * @typedef {Start | Decode | { do: 'cancel' }} Order
 */

/**
 * A frame that can be drawn.
 * @typedef {object} Frame
 * @property {number} triangles how many it has
 * @property {Parts | null} parts the parts of its surface, by place, of a large scene without colour: it shares those that stand still
 *   with the frames beside it. `positions`, `normals` and `indices` are empty then. Null of other frames
 * @property {Float32Array} positions x, y, z of each vertex in metres
 * @property {Float32Array} normals unit normal of each vertex
 * @property {Uint8Array} colours red, green, blue of each vertex, 8-bit sRGB; empty in streams without colour
 * @property {Uint32Array} indices three vertices a triangle
 * @property {[number, number, number, number, number, number]} bounds smallest x, y, z and largest; of a frame without vertices all 0
 * @property {number} timestampNs when it is shown, in nanoseconds
 * @property {boolean} keyframe
 * @property {number} inexactBlocks blocks that are not what was encoded
 * @property {number} packetBytes
 * @property {number} stream which of the take's streams it comes from: 0, but in a ladder
 * @property {number} bytes what the arrays take
 * @property {number} decodeMs
 * @property {number} surfaceMs
 * @property {(import('./wasm.js').BlockDetails & { vertexBits: Float32Array }) | null} details how blocks are coded, and for each
 *   vertex the bits of the block around it; null unless it was asked for
 */

/**
 * @typedef {import('./parts.js').Parts} Parts
 * @typedef {import('./parts.js').SurfaceChanges} SurfaceChanges
 */

/**
 * What a worker says. `done` answers each packet; it has a frame if a surface was wanted, and there was all of it once. `lost`: the packet cannot be decoded, and
 * what waited of the same run is forgotten; `refused` is set if it is sound but needs too much memory, and `blocks` says how many
 * blocks it has, if that is known. `memoryBytes`: the decoder's memory. `broken`: the worker cannot go on.
 *
 * A frame that comes in parts has those that changed, in `changes`; its {@link Frame.parts} are not known yet.
 * @typedef {{ is: 'ready' }} Ready
 * @typedef {{ is: 'done', run: number, frame: number, mesh: Frame & { changes?: SurfaceChanges | null } | null, memoryBytes?: number }} Done
 * @typedef {{ is: 'lost', run: number, frame: number, message: string, refused?: boolean, blocks?: number }} Lost
 * @typedef {Ready | Done | Lost | { is: 'broken', message: string }} Answer
 */

/** Blocks of a frame from which on its surface is kept in parts. A person at 5 mm has 2,000. */
const PARTS_FROM = 16_384;
/** Share of the parts that change in a frame from which on it is faster to extract the surface as a whole. */
const RESTLESS = 0.5;

/** The part of a worker's global scope that is used. */
const scope = /** @type {{ postMessage(answer: Answer, transfer?: Transferable[]): void, onmessage: unknown }} */ (
  /** @type {unknown} */ (globalThis)
);

/** @type {Decoder | null} */
let decoder = null;
/** @type {import('./wasm.js').StreamFacts | null} */
let facts = null;
/** @type {Decode[]} */
let waiting = [];
/** Whether a frame was what was encoded. Who comes into a stream at a resilient frame has only parts of it at first. */
let whole = false;
/** Whether most parts of the surface change from frame to frame, as far as is known since the keyframe. */
let restless = false;
/** The frame whose surface came in parts last. */
let parted = -2;
/** The run whose packets cannot be decoded any more. */
let lostRun = -1;
const turns = new MessageChannel();
turns.port1.onmessage = next;

scope.onmessage = (/** @type {MessageEvent<Order>} */ { data }) => {
  if (data.do === 'start') start(data);
  else if (data.do === 'cancel') waiting = [];
  else if (waiting.push(data) === 1 && facts) turns.port2.postMessage(null);
};

/** @param {Start} order */
async function start({ module, header, allowance }) {
  try {
    decoder = await Decoder.create(module);
    if (allowance) decoder.limit(allowance.voxels, allowance);
    facts = decoder.open(header);
    scope.postMessage({ is: 'ready' });
    // What came meanwhile.
    if (waiting.length) turns.port2.postMessage(null);
  } catch (error) {
    scope.postMessage({ is: 'broken', message: words(error) });
  }
}

function next() {
  const order = waiting.shift();
  if (order && order.run !== lostRun) decode(order);
  if (waiting.length) turns.port2.postMessage(null);
}

/** @param {Decode} order */
function decode({ run, frame, packet, at, surface, details, stream, header }) {
  if (!decoder || !facts) return;
  try {
    if (header) facts = decoder.open(header);
    const parts = details || facts.colour || restless ? Infinity : PARTS_FROM;
    const decoded = decoder.decode(packet, { at, surface, normals: true, details, parts });
    noteChanges(decoded, frame);
    const { memoryBytes } = decoder;
    whole ||= decoded.inexactBlocks === 0;
    if (!surface || !whole) return scope.postMessage({ is: 'done', run, frame, mesh: null, memoryBytes });
    const mesh = finished(decoded, facts, packet.length, stream);
    scope.postMessage({ is: 'done', run, frame, mesh, memoryBytes }, buffersOf(mesh));
  } catch (error) {
    lostRun = run;
    const refused = error instanceof IsvError && error.kind === 'limit';
    scope.postMessage({ is: 'lost', run, frame, message: words(error), refused, blocks: refused ? error.blocks : 0 });
  }
}

/** Notes whether it pays to go on with parts. @param {import('./wasm.js').DecodedFrame} decoded @param {number} frame */
function noteChanges({ keyframe, changes }, frame) {
  // Behind a seek all parts are others than those of the frame that came before.
  const follows = frame === parted + 1;
  if (changes) parted = frame;
  if (keyframe) restless = false;
  else if (changes && follows) restless = changes.changed.length / 5 > RESTLESS * changes.count;
}

/** @param {import('./wasm.js').DecodedFrame} decoded @param {import('./wasm.js').StreamFacts} facts @param {number} packetBytes @param {number} stream @returns {Frame & { changes: SurfaceChanges | null }} */
function finished({ blocks, changes, ...decoded }, facts, packetBytes, stream) {
  const { positions, indices } = decoded;
  const details = blocks ? { ...blocks, vertexBits: bitsOfVertices(positions, blocks, facts) } : null;
  const bounds = changes ? /** @type {Frame['bounds']} */ ([0, 0, 0, 0, 0, 0]) : boundsOf(positions);
  const more = { bounds, details, packetBytes, stream, triangles: indices.length / 3, parts: null, bytes: 0 };
  const mesh = { ...decoded, ...more, changes: changes && { ...changes, bounds: boundsOfParts(positions, changes) } };
  mesh.bytes = buffersOf(mesh).reduce((bytes, buffer) => bytes + buffer.byteLength, 0);
  return mesh;
}

/** @param {Frame & { changes: SurfaceChanges | null }} mesh @returns {ArrayBuffer[]} */
function buffersOf({ positions, normals, colours, indices, details, changes }) {
  const arrays = [positions, normals, colours, indices];
  const more = details ? [details.places, details.bits, details.motion, details.vertexBits] : [];
  const parts = changes ? [changes.changed, changes.removed, changes.bounds] : [];
  return [...arrays, ...more, ...parts].map((array) => /** @type {ArrayBuffer} */ (array.buffer));
}
