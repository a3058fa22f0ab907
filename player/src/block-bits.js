// Bits of blocks carried over to the vertices of the surface, for a heat map.

/**
 * What the block around each vertex took.
 * @param {Float32Array} positions x, y, z of each vertex in metres
 * @param {import('./worker.js').BlockDetails} details
 * @param {{ voxelSize: number, blockSide: number }} facts
 * @returns {Float32Array} bits, one a vertex; 0 where the frame has no such block
 */
export function colourByBits(positions, details, { voxelSize, blockSide }) {
  const { blocks, bits } = details;
  const bitsAt = new Map();
  for (let block = 0; block < bits.length; block++) {
    bitsAt.set(key(blocks[4 * block], blocks[4 * block + 1], blocks[4 * block + 2]), bits[block]);
  }
  const blocksAMetre = 1 / (voxelSize * blockSide);
  const vertexBits = new Float32Array(positions.length / 3);
  for (let vertex = 0; vertex < vertexBits.length; vertex++) {
    const [x, y, z] = [0, 1, 2].map((axis) => Math.floor(positions[3 * vertex + axis] * blocksAMetre));
    vertexBits[vertex] = bitsAt.get(key(x, y, z)) ?? 0;
  }
  return vertexBits;
}

/** One number for a block coordinate, -2^20 to 2^20 - 1 an axis: exact up to 2^53 for blocks near the others, and equal only by chance far off. @param {number} x @param {number} y @param {number} z */
function key(x, y, z) {
  return ((x & 0x1ffff) * 0x20000 + (y & 0x1ffff)) * 0x20000 + (z & 0x1ffff);
}
