// Ways of looking at a player's frames: the surface in its colour, by light, by its normals or as triangles, and what the codec made of it.

import { DoubleSide, LineSegments, ShaderMaterial, Vector3, Vector4 } from 'three';
import { BlockGrid, MotionVectors } from './block-overlays.js';
import { channels } from './colour.js';
import { EdgeGeometry } from './edge-geometry.js';
import { HEAT_BITS, HEAT_GLSL } from './heat.js';
import { VertexBits } from './vertex-bits.js';

/**
 * @typedef {'colour' | 'shaded' | 'normals' | 'wireframe' | 'blocks' | 'motion' | 'bits'} View
 * @typedef {{ name: View, title: string, says: string, details: boolean }} ViewFacts what a view is called, what it shows, and whether it needs details of blocks
 */

/** @type {readonly ViewFacts[]} */
export const VIEWS = [
  { name: 'colour', title: 'Colour', says: 'The surface in the colour of the capture, unlit', details: false },
  { name: 'shaded', title: 'Shaded', says: 'The surface, lit', details: false },
  {
    name: 'normals',
    title: 'Normals',
    says: 'The surface, coloured by where it faces: red is x, green y, blue z; magenta is its back',
    details: false,
  },
  { name: 'wireframe', title: 'Wireframe', says: 'The triangles of the surface', details: false },
  {
    name: 'blocks',
    title: 'Block grid',
    says: 'The coded blocks: blue predicted from the frame before, orange coded without it, grey standing still',
    details: true,
  },
  {
    name: 'motion',
    title: 'Motion',
    says: 'Motion vectors, three times as long as they are: each points to where its block is',
    details: true,
  },
  { name: 'bits', title: 'Bits', says: 'What each block took in the file', details: true },
];

/** Vertex shader that hands on the normal in the axes of the capture and the same in the camera's. */
const SURFACE_VERTEX = /* glsl */ `
  attribute float bits;
  varying vec3 vNormal;
  varying float vFacing;
  varying float vBits;
  void main() {
    vNormal = normal;
    vBits = bits;
    vec4 seen = modelViewMatrix * vec4(position, 1.0);
    vec3 towards = isOrthographic ? vec3(0.0, 0.0, 1.0) : normalize(-seen.xyz);
    vFacing = dot(normalize(normalMatrix * normal), towards);
    gl_Position = projectionMatrix * seen;
  }`;

/** As `isv render` colours: the normal, darker where it turns away; the inside magenta. */
const NORMALS_FRAGMENT = /* glsl */ `
  varying vec3 vNormal;
  varying float vFacing;
  void main() {
    vec3 colour = (normalize(vNormal) * 0.5 + 0.5) * (0.5 + 0.5 * max(vFacing, 0.0));
    gl_FragColor = vec4(gl_FrontFacing ? colour : vec3(0.84, 0.09, 0.38), 1.0);
  }`;

/** Only the form, for other things to be seen on. */
const FORM_FRAGMENT = /* glsl */ `
  uniform vec3 colour;
  varying float vFacing;
  void main() {
    gl_FragColor = vec4(colour * (0.55 + 0.45 * abs(vFacing)), 1.0);
  }`;

const BITS_FRAGMENT = /* glsl */ `
  varying float vFacing;
  varying float vBits;
  ${HEAT_GLSL}
  void main() {
    float part = log2(1.0 + vBits) / log2(1.0 + ${HEAT_BITS.toFixed(1)});
    gl_FragColor = vec4(heat(part) * (0.7 + 0.3 * abs(vFacing)), 1.0);
  }`;

/** Edges grow faint where triangles are as small as pixels, so that the form can still be seen. */
const EDGE_VERTEX = /* glsl */ `
  uniform float voxel;
  uniform float height;
  varying float vAlpha;
  void main() {
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    float pixels = voxel * projectionMatrix[1][1] * height * 0.5 / gl_Position.w;
    vAlpha = clamp(pixels / 16.0, 0.12, 0.75);
  }`;

const EDGE_FRAGMENT = /* glsl */ `
  uniform vec3 colour;
  varying float vAlpha;
  void main() {
    gl_FragColor = vec4(colour, vAlpha);
  }`;

/** Switches a player between views. What a view needs is made when it is first looked at. */
export class IsvViews {
  /** @type {View} */
  #view;
  #player;
  /** @type {Map<string, ShaderMaterial>} */
  #materials = new Map();
  #edges = new LineSegments(new EdgeGeometry(), edgeMaterial());
  #grid = new BlockGrid();
  #motion = new MotionVectors();
  #bits = new VertexBits();
  #onframe = () => this.#refresh();
  #onopen = () => this.#apply();

  /** @param {import('./player.js').IsvPlayer} player */
  constructor(player) {
    this.#player = player;
    this.#view = player.isDressed ? 'shaded' : 'colour';
    this.#edges.frustumCulled = false;
    const { uniforms } = this.#edges.material;
    this.#edges.onBeforeRender = (renderer) => {
      uniforms.height.value = renderer.getCurrentViewport(new Vector4()).w;
      uniforms.voxel.value = player.facts?.voxelSize ?? 0;
    };
    player.object.add(this.#edges, this.#grid, this.#motion);
    player.addEventListener('frame', this.#onframe);
    player.addEventListener('open', this.#onopen);
    this.colours = { form: 0x9aa0a8, edges: 0x1b66c9 };
    this.#apply();
  }

  /** The view; that of colour is `shaded` where the stream has none. */
  get view() {
    return this.#view === 'colour' && !this.#player.facts?.colour ? 'shaded' : this.#view;
  }

  set view(view) {
    if (!VIEWS.some(({ name }) => name === view)) throw new RangeError(`there is no view ${view}`);
    this.#view = view;
    this.#apply();
  }

  /** Colours, as numbers, of the surface under overlays and of triangles' edges. @param {{ form: number, edges: number }} colours */
  set colours({ form, edges }) {
    this.#material('form').uniforms.colour.value.set(...channels(form));
    this.#edges.material.uniforms.colour.value.set(...channels(edges));
  }

  dispose() {
    this.#player.removeEventListener('frame', this.#onframe);
    this.#player.removeEventListener('open', this.#onopen);
    this.#player.object.remove(this.#edges, this.#grid, this.#motion);
    const { facts, isDressed, materials } = this.#player;
    this.#player.mesh.material = facts?.colour && !isDressed ? materials.colour : materials.shaded;
    for (const one of [this.#edges, this.#grid, this.#motion]) {
      one.geometry.dispose();
      /** @type {import('three').Material} */ (one.material).dispose();
    }
    for (const material of this.#materials.values()) material.dispose();
  }

  #apply() {
    const { view } = this;
    const form = ['wireframe', 'blocks', 'motion'].includes(view);
    const own = view === 'colour' || view === 'shaded' ? this.#player.materials[view] : null;
    this.#player.mesh.material = own ?? this.#material(form ? 'form' : view);
    this.#edges.visible = view === 'wireframe';
    this.#grid.visible = view === 'blocks';
    this.#motion.visible = view === 'motion';
    this.#player.details = VIEWS.some(({ name, details }) => name === view && details);
    this.#refresh();
  }

  #refresh() {
    const { shown, facts, mesh } = this.#player;
    if (!shown || !facts) return;
    const geometry = /** @type {import('./moving-geometry.js').MovingGeometry} */ (mesh.geometry);
    if (this.#view === 'wireframe') /** @type {EdgeGeometry} */ (this.#edges.geometry).show(geometry, geometry.drawn);
    if (this.#view === 'bits') this.#bits.show(geometry, shown.details?.vertexBits ?? null);
    if (this.#view === 'blocks') this.#grid.show(shown.details, facts);
    if (this.#view === 'motion') this.#motion.show(shown.details, facts);
  }

  /** @param {string} name */
  #material(name) {
    const made = this.#materials.get(name) ?? surfaceMaterial(name);
    this.#materials.set(name, made);
    return made;
  }
}

/** @param {string} name */
function surfaceMaterial(name) {
  const fragmentShader = name === 'normals' ? NORMALS_FRAGMENT : name === 'bits' ? BITS_FRAGMENT : FORM_FRAGMENT;
  const offset = name === 'form' ? { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 2 } : {};
  const uniforms = { colour: { value: new Vector3(0.6, 0.62, 0.65) } };
  return new ShaderMaterial({ vertexShader: SURFACE_VERTEX, fragmentShader, uniforms, side: DoubleSide, ...offset });
}

function edgeMaterial() {
  const uniforms = { colour: { value: new Vector3() }, voxel: { value: 0 }, height: { value: 1 } };
  const shaders = { vertexShader: EDGE_VERTEX, fragmentShader: EDGE_FRAGMENT };
  return new ShaderMaterial({ ...shaders, uniforms, transparent: true, depthWrite: false });
}
