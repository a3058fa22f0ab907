// A number a vertex, beside a moving geometry's own attributes.

import { BufferAttribute, DynamicDrawUsage } from 'three';

export class VertexBits {
  /** Gives a geometry the attribute `bits`, which goes when the geometry's buffers do. @param {import('three').BufferGeometry} geometry @param {Float32Array | null} bits 0 everywhere if null */
  show(geometry, bits) {
    const room = geometry.getAttribute('position')?.count ?? 0;
    let attribute = /** @type {BufferAttribute | undefined} */ (geometry.getAttribute('bits'));
    if (attribute?.count !== room) {
      attribute = new BufferAttribute(new Float32Array(room), 1).setUsage(DynamicDrawUsage);
      geometry.setAttribute('bits', attribute);
    }
    if (bits) attribute.array.set(bits);
    else attribute.array.fill(0);
    attribute.needsUpdate = true;
  }
}
