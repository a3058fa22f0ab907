// A take in a scene of one's own. Serve the folder `player`, and open `example/?src=` and the address of an .isv file.

import { DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, WebGLRenderer } from 'three';
import { IsvPlayer } from 'isv-player';

const url = new URLSearchParams(location.search).get('src') ?? 'take.isv';
const player = new IsvPlayer({ url, autoplay: true });

const scene = new Scene();
const sun = new DirectionalLight(0xffffff, 2);
sun.position.set(1, 2, 3);
scene.add(player.object, sun, new HemisphereLight(0xffffff, 0x777777, 1.5));

const renderer = new WebGLRenderer({ antialias: true, alpha: true });
document.body.append(renderer.domElement);
const camera = new PerspectiveCamera(35);

player.addEventListener('error', ({ detail }) => document.body.append(detail.message));
player.addEventListener('lost', ({ detail }) => console.warn(`frame ${detail.frame}: ${detail.message}`));

const button = /** @type {HTMLButtonElement} */ (document.querySelector('button'));
button.addEventListener('click', () => {
  if (player.playing) player.pause();
  else player.play();
  button.textContent = player.playing ? 'Pause' : 'Play';
});

renderer.setAnimationLoop((now) => {
  const { innerWidth: width, innerHeight: height } = window;
  renderer.setSize(width, height);
  camera.aspect = width / height;
  camera.updateProjectionMatrix();
  player.update(now);
  const sphere = player.mesh.geometry.boundingSphere;
  if (sphere?.radius) {
    camera.position.copy(sphere.center).addScalar(0);
    camera.position.z += sphere.radius * 3.6;
  }
  renderer.render(scene, camera);
});
