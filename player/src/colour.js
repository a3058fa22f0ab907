// Colours as shaders take them.

/** Red, green and blue, 0 to 1, of a colour as a number. @param {number} colour @returns {[number, number, number]} */
export function channels(colour) {
  return [(colour >> 16) / 255, ((colour >> 8) & 255) / 255, (colour & 255) / 255];
}
