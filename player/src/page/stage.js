// What is seen: one camera, one or two pictures side by side, the ground under them.

import {
  Box3,
  Color,
  DirectionalLight,
  GridHelper,
  Group,
  HemisphereLight,
  Matrix4,
  PerspectiveCamera,
  Scene,
  Vector3,
  WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { IsvFailure } from '../failure.js';
import { toYUp } from '../up.js';

const FIELD_OF_VIEW = 32;
/** Parts of the free height and width that a subject fills at most. */
const FILLED = { height: 0.82, width: 0.86 };
/** Where the camera stands of what has no side to be seen from: in front, a little to the right and above. */
const IN_FRONT = new Vector3(0.28, 0.16, 1).normalize();
/** Steepest view of an open surface, in radians: of ground, the horizon stays in the picture. */
const STEEPEST = Math.PI / 3;

/** @typedef {import('../player.js').IsvPlayer} IsvPlayer */

export class Stage {
  camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
  controls;
  renderer;
  /** Whether the picture must be drawn again. */
  stale = true;
  /** The last picture's time in ms, as far as this thread takes part in it. */
  drawMs = 0;
  /** Distance of the ground's lines in metres; 0 before there is ground. */
  spacing = 0;
  /** Pixels at the foot that panels cover: the picture's middle is above them. */
  covered = 0;
  #canvas;
  #divider;
  /** @type {{ scene: Scene, player: IsvPlayer, ground: Group }[]} */
  #pictures = [];
  /** The axis that the user wants to be up; null if that is left to the take. @type {import('../axes.js').Up | null} */
  #up = null;
  #gridShown = true;
  #box = new Box3();
  /** From where an open surface shows its front, in the axes of the capture. @type {[number, number, number] | null} */
  #facing = null;
  #dark = matchMedia('(prefers-color-scheme: dark)');

  /** @param {HTMLCanvasElement} canvas @param {HTMLElement} divider the line between two pictures */
  constructor(canvas, divider) {
    this.#canvas = canvas;
    this.#divider = divider;
    this.renderer = makeRenderer(canvas);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.12;
    this.controls.addEventListener('change', () => (this.stale = true));
    new ResizeObserver(() => this.#resize()).observe(canvas);
    this.#dark.addEventListener('change', () => this.#layGround());
    canvas.addEventListener('webglcontextrestored', () => (this.stale = true));
    this.#resize();
  }

  get dark() {
    return this.#dark.matches;
  }

  get up() {
    return this.#up ?? this.#pictures[0]?.player.up ?? 'y';
  }

  /** The axis of the capture that points up. */
  set up(up) {
    this.#up = up;
    for (const { player } of this.#pictures) player.up = up;
    this.fit(this.#box, this.#facing);
  }

  get grid() {
    return this.#gridShown;
  }

  set grid(shown) {
    this.#gridShown = shown;
    for (const { ground } of this.#pictures) ground.visible = shown;
    this.stale = true;
  }

  /** One picture a player, from left to right. @param {IsvPlayer[]} players */
  show(players) {
    this.#pictures = players.map((player) => {
      const scene = new Scene();
      const ground = new Group();
      if (this.#up) player.up = this.#up;
      ground.visible = this.#gridShown;
      scene.add(player.object, ground, new HemisphereLight(0xffffff, 0x77706a, 1.15));
      return { scene, player, ground };
    });
    this.#divider.hidden = players.length < 2;
    this.compile();
    this.#layGround();
    this.stale = true;
  }

  /** Makes the shaders of what is shown, while its first frame is decoded. */
  compile() {
    for (const { scene } of this.#pictures) this.renderer.compile(withLamp(scene, this.camera), this.camera);
  }

  /**
   * Looks at a box, in the axes of the capture: from the side that an open surface faces, else from in front.
   * @param {Box3} box
   * @param {[number, number, number] | null} [facing] as `facingOf` gives it
   */
  fit(box, facing = null) {
    if (box.isEmpty()) return;
    this.#box = box.clone();
    this.#facing = facing;
    const turned = this.#turnedBox();
    const size = turned.getSize(new Vector3());
    const centre = turned.getCenter(new Vector3());
    const aspect = this.#aspect();
    const half = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
    const width = Math.hypot(size.x, size.z);
    const free = 1 - this.covered / Math.max(1, this.#canvas.clientHeight);
    const towards = facing ? this.#towards(facing) : IN_FRONT;
    // Of an open surface, which may be ground, the depth is seen from above, too.
    const seen = facing ? size.y * Math.hypot(towards.x, towards.z) + width * Math.abs(towards.y) : size.y;
    const tall = seen / FILLED.height / Math.max(free, 0.3);
    const distance = Math.max(tall, width / FILLED.width / aspect) / 2 / half + width / 2;
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(towards, Math.max(distance, 1e-3));
    this.controls.update();
    this.#layGround();
    this.stale = true;
  }

  /** Turns the camera about what it looks at, in radians. @param {number} yaw @param {number} pitch */
  turn(yaw, pitch) {
    const { position } = this.camera;
    const arm = position.clone().sub(this.controls.target);
    const angle = Math.min(Math.PI - 0.01, Math.max(0.01, Math.acos(arm.y / arm.length()) - pitch));
    const heading = Math.atan2(arm.x, arm.z) + yaw;
    arm.setFromSphericalCoords(arm.length(), angle, heading);
    position.copy(this.controls.target).add(arm);
    this.controls.update();
    this.stale = true;
  }

  /** Moves to or from what it looks at. @param {number} factor of the distance */
  zoom(factor) {
    const { position } = this.camera;
    position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.stale = true;
  }

  /** Moves camera and what it looks at, in parts of their distance. @param {number} right @param {number} up */
  pan(right, up) {
    const distance = this.camera.position.distanceTo(this.controls.target);
    const move = new Vector3(right, up, 0).multiplyScalar(distance).applyQuaternion(this.camera.quaternion);
    this.camera.position.add(move);
    this.controls.target.add(move);
    this.controls.update();
    this.stale = true;
  }

  /** Draws if anything has changed. @returns {boolean} whether it did */
  draw() {
    this.controls.update();
    if (!this.stale || !this.#pictures.length) return false;
    this.stale = false;
    const begin = performance.now();
    const { clientWidth, clientHeight } = this.#canvas;
    const width = clientWidth / this.#pictures.length;
    const distance = this.camera.position.distanceTo(this.controls.target);
    const reach = this.#box.isEmpty() ? 1 : this.#box.getSize(new Vector3()).length();
    this.camera.near = Math.max(distance - 2 * reach, distance / 100);
    this.camera.far = distance + 30 * reach;
    this.camera.aspect = this.#aspect();
    this.camera.setViewOffset(width, clientHeight, 0, this.covered / 2, width, clientHeight);
    this.renderer.setScissorTest(this.#pictures.length > 1);
    this.#pictures.forEach(({ scene }, at) => {
      this.renderer.setViewport(at * width, 0, width, clientHeight);
      this.renderer.setScissor(at * width, 0, width, clientHeight);
      this.renderer.render(withLamp(scene, this.camera), this.camera);
    });
    this.drawMs = performance.now() - begin;
    return true;
  }

  /**
   * The first picture from another camera, as a PNG in a data URL: to be compared with pictures made elsewhere.
   * @param {[number, number, number]} position
   * @param {[number, number, number]} target
   * @param {number[]} projection 4 x 4, row by row
   */
  pictureFrom(position, target, projection) {
    const camera = new PerspectiveCamera();
    camera.position.set(...position);
    camera.lookAt(...target);
    camera.projectionMatrix.set(.../** @type {Parameters<import('three').Matrix4['set']>} */ (projection));
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
    const { clientWidth, clientHeight } = this.#canvas;
    this.renderer.setScissorTest(false);
    this.renderer.setViewport(0, 0, clientWidth, clientHeight);
    this.renderer.render(withLamp(this.#pictures[0].scene, camera), camera);
    this.stale = true;
    return this.#canvas.toDataURL();
  }

  #aspect() {
    const { clientWidth, clientHeight } = this.#canvas;
    return Math.max(1, clientWidth) / Math.max(1, this.#pictures.length) / Math.max(1, clientHeight);
  }

  #resize() {
    const { clientWidth, clientHeight } = this.#canvas;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.stale = true;
  }

  /** A direction in the axes of the capture as one of the scene, no steeper than is good to look at. @param {[number, number, number]} facing */
  #towards(facing) {
    const towards = new Vector3(...facing).applyQuaternion(toYUp(this.up));
    const across = Math.hypot(towards.x, towards.z);
    const pitch = Math.min(STEEPEST, Math.max(-STEEPEST, Math.atan2(towards.y, across)));
    // Of what faces straight up, the heading would be noise.
    const heading = across < 0.1 ? Math.atan2(IN_FRONT.x, IN_FRONT.z) : Math.atan2(towards.x, towards.z);
    return towards.setFromSphericalCoords(1, Math.PI / 2 - pitch, heading);
  }

  /** What is looked at, as it is turned. */
  #turnedBox() {
    return this.#box.clone().applyMatrix4(new Matrix4().makeRotationFromQuaternion(toYUp(this.up)));
  }

  #layGround() {
    if (this.#box.isEmpty()) return;
    const box = this.#turnedBox();
    const size = box.getSize(new Vector3());
    const centre = box.getCenter(new Vector3());
    this.spacing = roundLength(Math.max(size.x, size.y, size.z) / 8);
    const lines = 2 * Math.ceil((1.6 * Math.max(size.x, size.z, size.y * 0.6)) / this.spacing);
    const [main, fine] = this.dark ? [0x5b636d, 0x373d45] : [0xaab1b9, 0xcbd0d6];
    for (const { ground } of this.#pictures) {
      for (const old of ground.children) /** @type {GridHelper} */ (old).dispose();
      ground.clear();
      const grid = new GridHelper(lines * this.spacing, lines, new Color(main), new Color(fine));
      const onLine = (/** @type {number} */ x) => Math.round(x / this.spacing) * this.spacing;
      grid.position.set(onLine(centre.x), box.min.y - size.y * 1e-3, onLine(centre.z));
      ground.add(grid);
    }
    this.stale = true;
  }
}

/** @param {HTMLCanvasElement} canvas */
function makeRenderer(canvas) {
  try {
    return new WebGLRenderer({ canvas, antialias: true, alpha: true });
  } catch (cause) {
    throw new IsvFailure('unsupported', 'this browser cannot draw in three dimensions: WebGL 2 is missing or turned off', {
      cause,
    });
  }
}

/** The scene with a lamp over the camera's shoulder. @param {Scene} scene @param {PerspectiveCamera} camera */
function withLamp(scene, camera) {
  let lamp = /** @type {DirectionalLight | undefined} */ (scene.getObjectByName('lamp'));
  if (!lamp) {
    lamp = new DirectionalLight(0xffffff, 2.3);
    lamp.name = 'lamp';
    scene.add(lamp, lamp.target);
  }
  lamp.position.set(-0.45, 0.6, 1).applyQuaternion(camera.quaternion);
  return scene;
}

/** The nearest of 1, 2 and 5 times a power of ten. @param {number} length */
function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(Math.max(length, 1e-6)));
  const steps = [1, 2, 5, 10].map((step) => step * power);
  return steps.reduce((best, step) => (Math.abs(Math.log(step / length)) < Math.abs(Math.log(best / length)) ? step : best));
}
