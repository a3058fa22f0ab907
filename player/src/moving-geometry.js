// A three.js geometry that takes a new surface every frame. Its buffers are kept and written again, and replaced only when a
// surface is larger than all before.

import { Box3, BufferAttribute, BufferGeometry, DynamicDrawUsage, Sphere, Vector3 } from 'three';

/** Room left in new buffers, as the next surfaces will be a little larger. */
const SPARE = 1.25;

export class MovingGeometry extends BufferGeometry {
  /** How often buffers were replaced. */
  reallocations = 0;

  constructor() {
    super();
    this.boundingBox = new Box3();
    this.boundingSphere = new Sphere();
    this.setDrawRange(0, 0);
  }

  /** Takes a frame's surface; its arrays are copied. @param {import('./worker.js').Frame} frame */
  show({ positions, normals, colours, indices, bounds }) {
    this.#make(positions.length / 3, indices.length);
    this.#write(this.getAttribute('position'), positions);
    this.#write(this.getAttribute('normal'), normals);
    if (colours.length) this.#paint(colours);
    this.#write(/** @type {BufferAttribute} */ (this.index), indices);
    this.setDrawRange(0, indices.length);
    const box = /** @type {Box3} */ (this.boundingBox);
    box.min.fromArray(bounds, 0);
    box.max.fromArray(bounds, 3);
    const sphere = /** @type {Sphere} */ (this.boundingSphere);
    box.getCenter(sphere.center);
    sphere.radius = box.getSize(new Vector3()).length() / 2;
  }

  /** Sees to it that there is room. @param {number} vertices @param {number} indices */
  #make(vertices, indices) {
    const held = this.getAttribute('position')?.count ?? 0;
    const heldIndices = this.index?.count ?? 0;
    if (vertices <= held && indices <= heldIndices) return;
    // Frees the old buffers on the GPU, which belong to the attributes that are about to go; others' are too small now.
    this.dispose();
    for (const name of Object.keys(this.attributes)) this.deleteAttribute(name);
    this.reallocations++;
    const room = vertices <= held ? held : Math.ceil(vertices * SPARE);
    const roomForIndices = indices <= heldIndices ? heldIndices : Math.ceil((indices * SPARE) / 3) * 3;
    this.setAttribute('position', dynamic(new BufferAttribute(new Float32Array(3 * room), 3)));
    this.setAttribute('normal', dynamic(new BufferAttribute(new Float32Array(3 * room), 3)));
    this.setIndex(dynamic(new BufferAttribute(new Uint32Array(roomForIndices), 1)));
  }

  /** Takes sRGB colours of vertices, as the attribute `srgb`. @param {Uint8Array} colours */
  #paint(colours) {
    const room = this.getAttribute('position').count;
    if (!this.hasAttribute('srgb')) this.setAttribute('srgb', dynamic(new BufferAttribute(new Uint8Array(3 * room), 3, true)));
    this.#write(this.getAttribute('srgb'), colours);
  }

  /** @param {import('three').BufferAttribute | import('three').InterleavedBufferAttribute | import('three').GLBufferAttribute} attribute @param {Float32Array | Uint32Array | Uint8Array} values */
  #write(attribute, values) {
    const buffer = /** @type {BufferAttribute} */ (attribute);
    buffer.array.set(values);
    buffer.clearUpdateRanges();
    buffer.addUpdateRange(0, values.length);
    buffer.needsUpdate = true;
  }
}

/** @param {BufferAttribute} attribute */
function dynamic(attribute) {
  return attribute.setUsage(DynamicDrawUsage);
}
