// The camera of `isv render` (crates/apps/isv-render/src/camera.rs), as three.js takes it.

/** Part of the picture left free on every side. */
const MARGIN = 0.04;
/** Half the opening of the cone around the box, in radians. */
const HALF_OPENING = (12 * Math.PI) / 180;

/**
 * @param {Float32Array} positions of the mesh that fits into the picture, a square
 * @param {number} yaw degrees
 * @param {number} pitch degrees
 * @returns {{ position: number[], target: number[], projection: number[] }} projection: a matrix, row by row
 */
export function nativeCamera(positions, yaw, pitch) {
  const { low, high } = bounds(positions);
  const target = low.map((value, axis) => (value + high[axis]) / 2);
  const distance = Math.hypot(...high.map((value, axis) => value - low[axis])) / 2 / Math.sin(HALF_OPENING);
  const [y, p] = [yaw, pitch].map((degrees) => (degrees * Math.PI) / 180);
  const towards = [Math.sin(y) * Math.cos(p), Math.sin(p), Math.cos(y) * Math.cos(p)];
  const right = [Math.cos(y), 0, -Math.sin(y)];
  const up = cross(towards, right);
  const corners = Array.from({ length: 8 }, (_, c) =>
    [0, 1, 2].map((axis) => ((c >> axis) & 1 ? high : low)[axis] - target[axis]),
  );
  const seen = corners.map((corner) => {
    const nearer = distance / (distance - dot(corner, towards));
    return [dot(corner, right) * nearer, dot(corner, up) * nearer];
  });
  const [fromX, toX, fromY, toY] = [0, 1].flatMap((axis) => [
    Math.min(...seen.map((s) => s[axis])),
    Math.max(...seen.map((s) => s[axis])),
  ]);
  const scale = ((1 - 2 * MARGIN) * 2) / Math.max(toX - fromX, toY - fromY);
  const [middleX, middleY] = [((fromX + toX) / 2) * scale, ((fromY + toY) / 2) * scale];
  const [near, far] = [distance * 0.2, distance * 3];
  const projection = [
    [scale * distance, 0, middleX, 0],
    [0, scale * distance, middleY, 0],
    [0, 0, -(far + near) / (far - near), (-2 * far * near) / (far - near)],
    [0, 0, -1, 0],
  ];
  return { position: target.map((value, axis) => value + distance * towards[axis]), target, projection: projection.flat() };
}

/** @param {Float32Array} positions */
function bounds(positions) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  positions.forEach((value, at) => {
    low[at % 3] = Math.min(low[at % 3], value);
    high[at % 3] = Math.max(high[at % 3], value);
  });
  return { low, high };
}

/** @param {number[]} a @param {number[]} b */
function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** @param {number[]} a @param {number[]} b */
function dot(a, b) {
  return a.reduce((sum, value, axis) => sum + value * b[axis], 0);
}
