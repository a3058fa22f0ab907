// What each of the takes on the page may use of the machine.

/** Bytes of decoded frames that all takes hold together. */
const MEMORY = 384 << 20;

/** @param {number} takes how many there are @returns {{ memory: number, workers: number }} */
export function shareOf(takes) {
  const cores = Math.min(navigator.hardwareConcurrency || 2, 4);
  return { memory: MEMORY / takes, workers: Math.ceil(cores / takes) };
}

/** Files that the page's address names: one, or two to be compared. @param {URLSearchParams} query @returns {string[]} */
export function filesOf(query) {
  return [query.get('src'), query.get('compare')].filter((url) => url !== null);
}
