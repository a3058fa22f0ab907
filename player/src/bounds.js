// Boxes around vertices.

/** @typedef {[number, number, number, number, number, number]} Bounds smallest x, y, z and largest */

/** The box around vertices; all 0 without any. @param {Float32Array} positions @returns {Bounds} */
export function boundsOf(positions) {
  if (positions.length === 0) return [0, 0, 0, 0, 0, 0];
  let [left, low, back] = positions;
  let [right, high, front] = positions;
  for (let at = 3; at < positions.length; at += 3) {
    const x = positions[at];
    const y = positions[at + 1];
    const z = positions[at + 2];
    if (x < left) left = x;
    if (x > right) right = x;
    if (y < low) low = y;
    if (y > high) high = y;
    if (z < back) back = z;
    if (z > front) front = z;
  }
  return [left, low, back, right, high, front];
}

/** The box around each part that changed, six numbers a part. @param {Float32Array} positions @param {import('./wasm.js').PartChanges} changes */
export function boundsOfParts(positions, { changed }) {
  const bounds = new Float32Array((changed.length / 5) * 6);
  let first = 0;
  for (let part = 0; part < changed.length / 5; part++) {
    const end = first + 3 * changed[5 * part + 3];
    bounds.set(boundsOf(positions.subarray(first, end)), 6 * part);
    first = end;
  }
  return bounds;
}
