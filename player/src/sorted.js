/** Searching in ascending numbers. */

/** Index of the last entry that is not above a value, -1 if all are. @param {ArrayLike<number>} sorted @param {number} value */
export function upTo(sorted, value) {
  let low = 0;
  let high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}
