// The axis of a capture that points up. three.js has Y up.

import { Matrix4, Quaternion } from 'three';

/**
 * Rotations that take an axis to Y, row by row: the table of `isv --up` (`crates/apps/isv-take/src/up.rs`).
 * @type {Record<import('./axes.js').Up, number[]>}
 */
const ROWS = {
  y: [1, 0, 0, 0, 1, 0, 0, 0, 1],
  z: [1, 0, 0, 0, 0, 1, 0, -1, 0],
  x: [0, -1, 0, 1, 0, 0, 0, 0, 1],
  '-y': [1, 0, 0, 0, -1, 0, 0, 0, -1],
  '-z': [1, 0, 0, 0, 0, -1, 0, 1, 0],
  '-x': [0, 1, 0, -1, 0, 0, 0, 0, 1],
};

/** The rotation that takes an axis to Y. @param {import('./axes.js').Up} up @returns {Quaternion} */
export function toYUp(up) {
  const [a, b, c, d, e, f, g, h, i] = ROWS[up];
  return new Quaternion().setFromRotationMatrix(new Matrix4().set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1));
}
