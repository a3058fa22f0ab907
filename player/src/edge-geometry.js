// The edges of a surface's triangles as lines, over the same vertices.

import { BufferAttribute, BufferGeometry, DynamicDrawUsage } from 'three';

export class EdgeGeometry extends BufferGeometry {
  /** Frees the lines. The vertices are the surface's, whose buffers stay. */
  dispose() {
    this.deleteAttribute('position');
    super.dispose();
  }

  /** @param {BufferGeometry} surface whose vertices are used @param {Uint32Array} indices three vertices a triangle */
  show(surface, indices) {
    const lines = 2 * indices.length;
    if (!this.index || this.index.count < lines) {
      this.dispose();
      this.setIndex(new BufferAttribute(new Uint32Array(Math.ceil(lines * 1.25)), 1).setUsage(DynamicDrawUsage));
    }
    const index = /** @type {BufferAttribute} */ (this.index);
    const ends = index.array;
    // Edges of two triangles are drawn twice: leaving one out would leave out those of rims, too.
    for (let corner = 0, at = 0; corner < indices.length; corner += 3) {
      const a = indices[corner];
      const b = indices[corner + 1];
      const c = indices[corner + 2];
      ends[at++] = a;
      ends[at++] = b;
      ends[at++] = b;
      ends[at++] = c;
      ends[at++] = c;
      ends[at++] = a;
    }
    index.clearUpdateRanges();
    index.addUpdateRange(0, lines);
    index.needsUpdate = true;
    this.setAttribute('position', surface.getAttribute('position'));
    this.setDrawRange(0, lines);
  }
}
