// The side of a surface to look at first.
//
// The rule: A is the sum of the triangles' area vectors (half the cross product of two edges, outward), S the sum of their lengths.
// From a direction d, front faces cover `A.d` more area than back faces, so they lead most along A. A closed surface has A = 0. Where
// |A| is at least a fifth of S the surface is open, as a depth take is: the camera then stands along A, which is where the cameras of
// the take stood. Otherwise it stands in front.

import { piecesOf } from './parts.js';

/** Part of the surface's area that |A| reaches where the surface counts as open. */
export const OPEN_PART = 0.2;
/** Most triangles that are looked at. */
const MOST_TRIANGLES = 200_000;

/**
 * The sum of area vectors, and the area, of every so many triangles.
 * @param {{ positions: Float32Array, indices: Uint32Array }} surface
 * @param {number} step
 * @returns {{ vector: [number, number, number], area: number }}
 */
function areaVector({ positions, indices }, step) {
  const triangles = indices.length / 3;
  let [x, y, z, area] = [0, 0, 0, 0];
  for (let triangle = 0; triangle < triangles; triangle += step) {
    const [a, b, c] = [3 * indices[3 * triangle], 3 * indices[3 * triangle + 1], 3 * indices[3 * triangle + 2]];
    const [ux, uy, uz] = [positions[b] - positions[a], positions[b + 1] - positions[a + 1], positions[b + 2] - positions[a + 2]];
    const [vx, vy, vz] = [positions[c] - positions[a], positions[c + 1] - positions[a + 1], positions[c + 2] - positions[a + 2]];
    const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    x += nx / 2;
    y += ny / 2;
    z += nz / 2;
    area += Math.hypot(nx, ny, nz) / 2;
  }
  return { vector: [x, y, z], area };
}

/**
 * The direction, in the axes of the capture, from which an open surface shows its front.
 * @param {import('./parts.js').Drawn} frame
 * @returns {[number, number, number] | null} a unit vector; null where the surface is closed, or there is none
 */
export function facingOf(frame) {
  const pieces = piecesOf(frame);
  const triangles = pieces.reduce((sum, { indices }) => sum + indices.length / 3, 0);
  const step = Math.max(1, Math.ceil(triangles / MOST_TRIANGLES));
  let [x, y, z, area] = [0, 0, 0, 0];
  for (const piece of pieces) {
    const { vector, area: more } = areaVector(piece, step);
    x += vector[0];
    y += vector[1];
    z += vector[2];
    area += more;
  }
  const length = Math.hypot(x, y, z);
  if (!(area > 0) || length < OPEN_PART * area) return null;
  return [x / length, y / length, z / length];
}
