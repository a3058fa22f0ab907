// What the decoder knows of blocks, drawn over the surface: where they are and how they were coded, and their motion vectors.

import {
  BufferAttribute,
  DoubleSide,
  DynamicDrawUsage,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  LineSegments,
  Mesh,
  ShaderMaterial,
} from 'three';
import { channels } from './colour.js';

/** How much longer motion vectors are drawn than they are. */
export const MOTION_SCALE = 3;
/** Length of a vector, in voxels, at the warm end of its colours. */
export const MOTION_VOXELS = 4;

/** sRGB colours of the kinds of blocks: standing still, coded without a reference, predicted. */
export const BLOCK_COLOURS = [0x8a8f98, 0xe8833a, 0x3f8fe0];

/** The twelve edges of a unit cube, as pairs of corners. */
const CUBE_EDGES = Float32Array.from(
  [0, 1, 2].flatMap((axis) =>
    [0, 1, 2, 3].flatMap((corner) =>
      [0, 1].flatMap((end) => {
        const point = [0, 0, 0];
        point[axis] = end;
        point[(axis + 1) % 3] = corner & 1;
        point[(axis + 2) % 3] = corner >> 1;
        return point;
      }),
    ),
  ),
);

const GRID_VERTEX = /* glsl */ `
  attribute vec4 block;
  uniform float side;
  uniform vec3 kinds[3];
  varying vec3 vColour;
  void main() {
    vColour = kinds[int(block.w + 0.5)];
    gl_Position = projectionMatrix * modelViewMatrix * vec4((block.xyz + position) * side, 1.0);
  }`;

const PLAIN_FRAGMENT = /* glsl */ `
  varying vec3 vColour;
  void main() {
    gl_FragColor = vec4(vColour, 1.0);
  }`;

/** A dart from where a block comes from to where it is, turned to the camera and drawn a block nearer, so that the surface does not hide it. */
const DART_VERTEX = /* glsl */ `
  attribute vec3 block;
  attribute vec3 motion;
  uniform float side;
  uniform float longest;
  varying vec3 vColour;
  void main() {
    vec3 head = (modelViewMatrix * vec4((block + 0.5) * side, 1.0)).xyz;
    vec3 along = (modelViewMatrix * vec4(motion, 0.0)).xyz * ${MOTION_SCALE.toFixed(1)};
    vec3 across = normalize(cross(along, head) + vec3(1e-9)) * min(side * 0.22, length(along) * 0.3);
    vec3 seen = head - along * position.y + across * position.x;
    seen *= 1.0 - side / max(length(seen), 2.0 * side);
    float part = clamp(length(motion) / longest, 0.0, 1.0);
    vec3 slow = vec3(0.16, 0.42, 0.85);
    vec3 middle = vec3(0.1, 0.66, 0.48);
    vec3 fast = vec3(0.95, 0.45, 0.1);
    vColour = part < 0.5 ? mix(slow, middle, part * 2.0) : mix(middle, fast, part * 2.0 - 1.0);
    gl_Position = projectionMatrix * vec4(seen, 1.0);
  }`;

/** Edges of all blocks. */
export class BlockGrid extends LineSegments {
  constructor() {
    const geometry = new InstancedBufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(CUBE_EDGES, 3));
    geometry.instanceCount = 0;
    const uniforms = { side: { value: 1 }, kinds: { value: BLOCK_COLOURS.flatMap(channels) } };
    super(geometry, new ShaderMaterial({ vertexShader: GRID_VERTEX, fragmentShader: PLAIN_FRAGMENT, uniforms }));
    this.frustumCulled = false;
  }

  /** @param {import('./worker.js').BlockDetails | null} details @param {{ voxelSize: number, blockSide: number }} facts */
  show(details, { voxelSize, blockSide }) {
    const geometry = /** @type {InstancedBufferGeometry} */ (this.geometry);
    const blocks = details?.blocks ?? new Int32Array();
    instances(geometry, 'block', blocks, 4);
    geometry.instanceCount = blocks.length / 4;
    /** @type {ShaderMaterial} */ (this.material).uniforms.side.value = voxelSize * blockSide;
  }
}

/** A dart for each block that moves. */
export class MotionVectors extends Mesh {
  constructor() {
    const geometry = new InstancedBufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(Float32Array.from([-1, 0, 0, 1, 0, 0, 0, 1, 0]), 3));
    geometry.instanceCount = 0;
    const uniforms = { side: { value: 1 }, longest: { value: 1 } };
    super(
      geometry,
      new ShaderMaterial({ vertexShader: DART_VERTEX, fragmentShader: PLAIN_FRAGMENT, uniforms, side: DoubleSide }),
    );
    this.frustumCulled = false;
  }

  /** @param {import('./worker.js').BlockDetails | null} details @param {{ voxelSize: number, blockSide: number }} facts */
  show(details, { voxelSize, blockSide }) {
    const geometry = /** @type {InstancedBufferGeometry} */ (this.geometry);
    const { blocks, motion } = moving(details);
    instances(geometry, 'block', blocks, 3);
    instances(geometry, 'motion', motion, 3);
    geometry.instanceCount = blocks.length / 3;
    const { uniforms } = /** @type {ShaderMaterial} */ (this.material);
    uniforms.side.value = voxelSize * blockSide;
    uniforms.longest.value = voxelSize * MOTION_VOXELS;
  }
}

/** Coordinates and vectors of the blocks that moved. @param {import('./worker.js').BlockDetails | null} details */
function moving(details) {
  const blocks = [];
  const vectors = [];
  for (let block = 0; details && block < details.bits.length; block++) {
    const [x, y, z] = details.motion.subarray(3 * block, 3 * block + 3);
    if (x === 0 && y === 0 && z === 0) continue;
    blocks.push(details.blocks[4 * block], details.blocks[4 * block + 1], details.blocks[4 * block + 2]);
    vectors.push(x, y, z);
  }
  return { blocks, motion: vectors };
}

/** Writes an attribute of instances, into the same buffer while it is large enough. @param {InstancedBufferGeometry} geometry @param {string} name @param {ArrayLike<number>} values @param {number} size */
function instances(geometry, name, values, size) {
  let attribute = /** @type {InstancedBufferAttribute | undefined} */ (geometry.getAttribute(name));
  if (!attribute || attribute.array.length < values.length || !attribute.count) {
    geometry.dispose();
    const room = Math.max(1, Math.ceil((values.length * 1.25) / size));
    attribute = new InstancedBufferAttribute(new Float32Array(room * size), size);
    attribute.setUsage(DynamicDrawUsage);
    geometry.setAttribute(name, attribute);
  }
  attribute.array.set(values);
  attribute.needsUpdate = true;
}
