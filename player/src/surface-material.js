// Materials of a surface: in light, where both sides are drawn, the back in a tint of its own; and in its colour.

import { Color, DoubleSide, MeshBasicMaterial, MeshStandardMaterial } from 'three';

/** sRGB colour of a surface's front. */
export const FRONT_COLOUR = 0xb9bec6;
/** sRGB colour of its back, which is seen where the surface is open: in depth takes, at holes, under open soles. */
export const BACK_COLOUR = 0xc98a84;

/** @returns {MeshStandardMaterial} */
export function litMaterial() {
  const material = new MeshStandardMaterial({ color: FRONT_COLOUR, roughness: 0.75, side: DoubleSide });
  material.onBeforeCompile = (shader) => {
    shader.uniforms.backColour = { value: new Color(BACK_COLOUR) };
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <common>', '#include <common>\nuniform vec3 backColour;')
      .replace('#include <color_fragment>', '#include <color_fragment>\nif (!gl_FrontFacing) diffuseColor.rgb = backColour;');
  };
  material.customProgramCacheKey = () => 'isv-two-sides';
  return material;
}

/** Linear light of sRGB, both 0 to 1 (IEC 61966-2-1). */
const LINEAR_GLSL = /* glsl */ `
vec3 linearFromSrgb(vec3 srgb) {
  return mix(pow((srgb + 0.055) / 1.055, vec3(2.4)), srgb / 12.92, vec3(lessThanEqual(srgb, vec3(0.04045))));
}`;

/**
 * Material of a surface in the sRGB colours of its vertices, the attribute `srgb`: unlit, both sides alike. Between vertices sRGB
 * values are averaged as they are, as in video. What comes out is linear light for three.js, so that a canvas shows the colours
 * that went in.
 * @returns {MeshBasicMaterial}
 */
export function colouredMaterial() {
  const material = new MeshBasicMaterial({ side: DoubleSide, toneMapped: false });
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace('#include <common>', '#include <common>\nattribute vec3 srgb;\nvarying vec3 vSrgb;')
      .replace('#include <color_vertex>', '#include <color_vertex>\nvSrgb = srgb;');
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <common>', `#include <common>\nvarying vec3 vSrgb;${LINEAR_GLSL}`)
      .replace('#include <color_fragment>', '#include <color_fragment>\ndiffuseColor.rgb *= linearFromSrgb(vSrgb);');
  };
  material.customProgramCacheKey = () => 'isv-srgb';
  return material;
}
