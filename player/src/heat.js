// Colours of a heat map, from little to much.

/** Bits of a block at the hot end. Colours go by the logarithm. */
export const HEAT_BITS = 255;

/** Steps of the scale, sRGB 0 to 1, evenly apart: those of matplotlib's inferno without its blackest, which would hide the form. */
export const HEAT_STEPS = [
  [0.2, 0.15, 0.42],
  [0.47, 0.11, 0.43],
  [0.73, 0.21, 0.33],
  [0.93, 0.41, 0.15],
  [0.98, 0.71, 0.1],
  [0.99, 0.99, 0.65],
];

/** `vec3 heat(float part)`: the colour at a part of the scale, 0 to 1. */
export const HEAT_GLSL = /* glsl */ `
  vec3 heat(float part) {
    vec3 steps[${HEAT_STEPS.length}];
    ${HEAT_STEPS.map((step, at) => `steps[${at}] = vec3(${step.join(', ')});`).join('\n    ')}
    float at = clamp(part, 0.0, 1.0) * ${(HEAT_STEPS.length - 1).toFixed(1)};
    int low = int(min(floor(at), ${(HEAT_STEPS.length - 2).toFixed(1)}));
    return mix(steps[low], steps[low + 1], at - float(low));
  }`;

/** The scale as a CSS gradient, from left to right. */
export function heatGradient() {
  const stops = HEAT_STEPS.map((step) => `rgb(${step.map((part) => Math.round(part * 255)).join(' ')})`);
  return `linear-gradient(to right, ${stops.join(', ')})`;
}
