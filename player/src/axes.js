// Axes of a capture that may point up.

/** @typedef {'y' | 'z' | 'x' | '-y' | '-z' | '-x'} Up */

/** The axes in the order in which a key goes through them: the frequent ones first. @type {readonly Up[]} */
export const UPS = ['y', 'z', '-y', '-z', 'x', '-x'];

/** @param {unknown} name @returns {name is Up} */
export function isUp(name) {
  return UPS.includes(/** @type {Up} */ (name));
}
