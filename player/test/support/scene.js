// A scene: a floor that stands still, larger than what the player shows as a whole, and a box that moves over it.

import { writeFileSync } from 'node:fs';
import { join } from 'node:path';

/** Half the floor's edge, metres. */
const HALF = 8;
const CUBE = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => [0, 1, 2].map((axis) => (corner >> axis) & 1));
const CUBE_FACES = [
  [0, 2, 3, 1],
  [4, 5, 7, 6],
  [0, 1, 5, 4],
  [2, 6, 7, 3],
  [0, 4, 6, 2],
  [1, 3, 7, 5],
];

/** Writes frames into a folder. @param {string} folder @param {number} frames */
export function writeScene(folder, frames) {
  for (let frame = 0; frame < frames; frame++) {
    const floor = [-HALF, HALF].flatMap((x) => [-HALF, HALF].map((z) => [x, 0, z]));
    const box = CUBE.map(([x, y, z]) => [x - 1 + 0.07 * frame, y + 0.31, z]);
    const vertices = [...floor, ...box].map((vertex) => vertex.join(' '));
    const quads = [[0, 1, 3, 2], ...CUBE_FACES.map((face) => face.map((corner) => corner + 4))];
    const header = `ply\nformat ascii 1.0\nelement vertex ${vertices.length}\nproperty float x\nproperty float y\nproperty float z\n`;
    const faces = `element face ${quads.length}\nproperty list uchar int vertex_indices\nend_header\n`;
    const lines = [...vertices, ...quads.map((quad) => `4 ${quad.join(' ')}`)];
    writeFileSync(join(folder, `frame_${frame}.ply`), `${header}${faces}${lines.join('\n')}\n`);
  }
}
