// A three.js geometry that takes a new surface every frame. Its buffers are kept and written again, and replaced only when a
// surface is larger than all before.
//
// Of a surface in parts, each has a slot of the buffers, with some room. A frame writes those that are others than in the frame
// before it. Room for indices that a part does not fill has triangles without area.

import { Box3, BufferAttribute, BufferGeometry, DynamicDrawUsage, Sphere, Vector3 } from 'three';

/** Room left in new buffers, and in slots of parts, as the next surfaces will be a little larger. */
const SPARE = 1.25;

/** Ranges of a buffer that are remembered until they are copied to the GPU. */
const MOST_RANGES = 1 << 14;

/**
 * Where a part is in the buffers: first vertex and room for vertices, first index and room for indices.
 * @typedef {{ part: import('./parts.js').Part, vertex: number, vertices: number, index: number, indices: number }} Slot
 */

export class MovingGeometry extends BufferGeometry {
  /** How often buffers were replaced. */
  reallocations = 0;
  /** Slots of the parts that are drawn. @type {Map<string, Slot>} */
  #slots = new Map();
  /** Vertices and indices behind the last slot. */
  #end = { vertex: 0, index: 0 };

  constructor() {
    super();
    this.boundingBox = new Box3();
    this.boundingSphere = new Sphere();
    this.setDrawRange(0, 0);
  }

  /** The indices that are drawn, three a triangle. Some triangles of parts have no area. */
  get drawn() {
    const indices = /** @type {Uint32Array | undefined} */ (this.index?.array);
    return indices?.subarray(0, this.drawRange.count) ?? new Uint32Array(0);
  }

  /** Takes a frame's surface; its arrays are copied. @param {import('./worker.js').Frame} frame */
  show({ positions, normals, colours, indices, bounds, parts }) {
    if (parts) this.#showParts(parts);
    else this.#showWhole(positions, normals, colours, indices);
    const box = /** @type {Box3} */ (this.boundingBox);
    box.min.fromArray(bounds, 0);
    box.max.fromArray(bounds, 3);
    const sphere = /** @type {Sphere} */ (this.boundingSphere);
    box.getCenter(sphere.center);
    sphere.radius = box.getSize(new Vector3()).length() / 2;
  }

  /** @param {Float32Array} positions @param {Float32Array} normals @param {Uint8Array} colours @param {Uint32Array} indices */
  #showWhole(positions, normals, colours, indices) {
    this.#slots.clear();
    this.#make(positions.length / 3, indices.length);
    write(this.getAttribute('position'), positions);
    write(this.getAttribute('normal'), normals);
    if (colours.length) this.#paint(colours);
    write(this.index, indices);
    this.setDrawRange(0, indices.length);
  }

  /** @param {import('./parts.js').Parts} parts */
  #showParts(parts) {
    if (!this.#slots.size) return this.#layOut(parts);
    for (const [key, slot] of this.#slots) if (!parts.has(key)) this.#free(key, slot);
    for (const [key, part] of parts) {
      const slot = this.#slots.get(key);
      if (slot?.part === part) continue;
      if (slot && fits(part, slot)) this.#fill(slot, part);
      else {
        if (slot) this.#free(key, slot);
        if (!this.#append(key, part)) return this.#layOut(parts);
      }
    }
    this.setDrawRange(0, this.#end.index);
  }

  /** Lays all parts out anew, one behind the other. @param {import('./parts.js').Parts} parts */
  #layOut(parts) {
    this.#slots.clear();
    this.#end = { vertex: 0, index: 0 };
    let [vertices, indices] = [0, 0];
    for (const part of parts.values()) {
      vertices += room(part.positions.length / 3);
      indices += roomForIndices(part.indices.length);
    }
    this.#make(vertices, indices);
    for (const [key, part] of parts) this.#append(key, part);
    for (const attribute of this.#buffers) {
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, attribute === this.index ? this.#end.index : 3 * this.#end.vertex);
    }
    this.setDrawRange(0, this.#end.index);
  }

  /** Gives a part a slot behind all others. @param {string} key @param {import('./parts.js').Part} part @returns {boolean} whether there is room */
  #append(key, part) {
    const slot = {
      part,
      vertex: this.#end.vertex,
      vertices: room(part.positions.length / 3),
      index: this.#end.index,
      indices: roomForIndices(part.indices.length),
    };
    const end = { vertex: slot.vertex + slot.vertices, index: slot.index + slot.indices };
    if (end.vertex > (this.getAttribute('position')?.count ?? 0) || end.index > (this.index?.count ?? 0)) return false;
    this.#end = end;
    this.#slots.set(key, slot);
    this.#fill(slot, part);
    return true;
  }

  /** Writes a part into its slot. @param {Slot} slot @param {import('./parts.js').Part} part */
  #fill(slot, part) {
    slot.part = part;
    const [position, normal, index] = this.#buffers;
    position.array.set(part.positions, 3 * slot.vertex);
    normal.array.set(part.normals, 3 * slot.vertex);
    const { array } = index;
    for (let at = 0; at < part.indices.length; at++) array[slot.index + at] = slot.vertex + part.indices[at];
    array.fill(slot.vertex, slot.index + part.indices.length, slot.index + slot.indices);
    written(position, 3 * slot.vertex, part.positions.length);
    written(normal, 3 * slot.vertex, part.normals.length);
    written(index, slot.index, slot.indices);
  }

  /** Draws nothing more of a slot. @param {string} key @param {Slot} slot */
  #free(key, slot) {
    this.#slots.delete(key);
    const [, , index] = this.#buffers;
    index.array.fill(slot.vertex, slot.index, slot.index + slot.indices);
    written(index, slot.index, slot.indices);
  }

  /** Positions, normals and indices. @returns {BufferAttribute[]} */
  get #buffers() {
    return /** @type {BufferAttribute[]} */ ([this.getAttribute('position'), this.getAttribute('normal'), this.index]);
  }

  /** Sees to it that there is room. @param {number} vertices @param {number} indices */
  #make(vertices, indices) {
    const held = this.getAttribute('position')?.count ?? 0;
    const heldIndices = this.index?.count ?? 0;
    if (this.index && vertices <= held && indices <= heldIndices) return;
    // Frees the old buffers on the GPU, which belong to the attributes that are about to go; others' are too small now.
    this.dispose();
    for (const name of Object.keys(this.attributes)) this.deleteAttribute(name);
    this.reallocations++;
    const places = vertices <= held ? held : room(vertices);
    const placesForIndices = indices <= heldIndices ? heldIndices : roomForIndices(indices);
    this.setAttribute('position', dynamic(new BufferAttribute(new Float32Array(3 * places), 3)));
    this.setAttribute('normal', dynamic(new BufferAttribute(new Float32Array(3 * places), 3)));
    this.setIndex(dynamic(new BufferAttribute(new Uint32Array(placesForIndices), 1)));
  }

  /** Takes sRGB colours of vertices, as the attribute `srgb`. @param {Uint8Array} colours */
  #paint(colours) {
    const places = this.getAttribute('position').count;
    if (!this.hasAttribute('srgb')) this.setAttribute('srgb', dynamic(new BufferAttribute(new Uint8Array(3 * places), 3, true)));
    write(this.getAttribute('srgb'), colours);
  }
}

/** Writes a buffer from its beginning. @param {unknown} attribute @param {Float32Array | Uint32Array | Uint8Array} values */
function write(attribute, values) {
  const buffer = /** @type {BufferAttribute} */ (attribute);
  buffer.array.set(values);
  buffer.clearUpdateRanges();
  buffer.addUpdateRange(0, values.length);
  buffer.needsUpdate = true;
}

/** Has a part of a buffer copied to the GPU. @param {BufferAttribute} attribute @param {number} start @param {number} count */
function written(attribute, start, count) {
  attribute.addUpdateRange(start, count);
  // What is not in view is not copied, and its ranges would become more and more.
  if (attribute.updateRanges.length > MOST_RANGES) {
    attribute.clearUpdateRanges();
    attribute.addUpdateRange(0, attribute.array.length);
  }
  attribute.needsUpdate = true;
}

/** Room for so many vertices and some more. @param {number} count */
function room(count) {
  return Math.ceil(count * SPARE);
}

/** Room for the indices of so many and some more, of whole triangles. @param {number} count */
function roomForIndices(count) {
  return Math.ceil((count * SPARE) / 3) * 3;
}

/** @param {import('./parts.js').Part} part @param {Slot} slot */
function fits(part, slot) {
  return part.positions.length <= 3 * slot.vertices && part.indices.length <= slot.indices;
}

/** @param {BufferAttribute} attribute */
function dynamic(attribute) {
  // A new buffer is copied as a whole; three.js leaves the ranges for another time.
  return attribute.setUsage(DynamicDrawUsage).onUpload(() => attribute.clearUpdateRanges());
}
