// Surfaces of large scenes in parts. A frame has those parts that its decoder found changed; here it gets the others, which it shares
// with the frames before.

/**
 * A part of a surface. Its mesh stands alone: vertices at its border are in the parts beside it, too.
 * @typedef {object} Part
 * @property {Float32Array} positions x, y, z of each vertex in metres
 * @property {Float32Array} normals unit normal of each vertex
 * @property {Uint32Array} indices three vertices a triangle, counted from the part's first
 * @property {Float32Array} bounds smallest x, y, z and largest
 * @property {Batch} batch what it came with
 */

/**
 * The parts of a surface, by the coordinates of each one's lowest block, as text.
 * @typedef {Map<string, Part>} Parts
 */

/**
 * What the parts of a frame share memory with: all that changed in one frame. Memory is free again when none of its parts is used.
 * @typedef {{ bytes: number }} Batch
 */

/**
 * What changed since the last frame in parts that the same decoder gave, and a box around each part.
 * @typedef {import('./wasm.js').PartChanges & { bounds: Float32Array }} SurfaceChanges
 */

/** What a frame is drawn from. @typedef {{ positions: Float32Array, indices: Uint32Array, parts?: Parts | null }} Drawn */

/** The surface that one decoder has given so far. */
export class PartedSurface {
  /** @type {Parts} */
  #parts = new Map();

  /**
   * Completes a frame of which only changes have come. Each such frame of a decoder has to come here, in order.
   * @param {import('./worker.js').Frame & { changes?: SurfaceChanges | null }} frame
   * @returns {import('./worker.js').Frame & { batches?: Set<Batch> }}
   */
  complete({ changes, ...frame }) {
    if (!changes) return frame;
    const parts = changes.fresh ? new Map() : new Map(this.#parts);
    for (let at = 0; at < changes.removed.length; at += 3) parts.delete(keyOf(changes.removed, at));
    const batch = { bytes: frame.bytes };
    let [vertex, corner] = [0, 0];
    for (let at = 0, part = 0; at < changes.changed.length; at += 5, part++) {
      const vertexEnd = vertex + 3 * changes.changed[at + 3];
      const cornerEnd = corner + 3 * changes.changed[at + 4];
      parts.set(keyOf(changes.changed, at), {
        positions: frame.positions.subarray(vertex, vertexEnd),
        normals: frame.normals.subarray(vertex, vertexEnd),
        indices: frame.indices.subarray(corner, cornerEnd),
        bounds: changes.bounds.subarray(6 * part, 6 * part + 6),
        batch,
      });
      [vertex, corner] = [vertexEnd, cornerEnd];
    }
    this.#parts = parts;
    const nothing = { positions: new Float32Array(0), normals: new Float32Array(0), indices: new Uint32Array(0) };
    return { ...frame, ...nothing, ...summary(parts), parts };
  }
}

/**
 * The pieces that a frame is drawn from.
 * @param {Drawn} frame
 * @returns {{ positions: Float32Array, indices: Uint32Array }[]}
 */
export function piecesOf(frame) {
  return frame.parts ? [...frame.parts.values()] : [frame];
}

/** @param {Int32Array} places @param {number} at */
function keyOf(places, at) {
  return `${places[at]},${places[at + 1]},${places[at + 2]}`;
}

/** What is said of all parts together. @param {Parts} parts */
function summary(parts) {
  /** @type {Set<Batch>} */
  const batches = new Set();
  const [least, most] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  let triangles = 0;
  for (const { indices, bounds, batch } of parts.values()) {
    batches.add(batch);
    triangles += indices.length / 3;
    for (let axis = 0; axis < 3; axis++) {
      if (bounds[axis] < least[axis]) least[axis] = bounds[axis];
      if (bounds[axis + 3] > most[axis]) most[axis] = bounds[axis + 3];
    }
  }
  const bounds = /** @type {import('./bounds.js').Bounds} */ (parts.size ? [...least, ...most] : [0, 0, 0, 0, 0, 0]);
  return { batches, triangles, bounds };
}
