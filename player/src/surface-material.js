// The material of a lit surface: both sides are drawn, the back in a tint of its own.

import { Color, DoubleSide, MeshStandardMaterial } from 'three';

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
