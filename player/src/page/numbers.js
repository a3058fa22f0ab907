// Numbers as people read them.

/** @param {number} bytes */
export function asBytes(bytes) {
  if (bytes < 1000) return `${Math.round(bytes)} B`;
  if (bytes < 999_500) return `${(bytes / 1e3).toFixed(bytes < 9950 ? 1 : 0)} kB`;
  if (bytes < 999.5e6) return `${(bytes / 1e6).toFixed(bytes < 9.95e6 ? 1 : 0)} MB`;
  return `${(bytes / 1e9).toFixed(2)} GB`;
}

/** @param {number} bits a second */
export function asBitrate(bits) {
  return bits < 999_500 ? `${Math.round(bits / 1e3)} kbit/s` : `${(bits / 1e6).toFixed(2)} Mbit/s`;
}

/** @param {number} ms */
export function asMs(ms) {
  return `${ms.toFixed(ms < 9.95 ? 1 : 0)} ms`;
}

/** @param {number} metres */
export function asLength(metres) {
  if (metres < 0.00995) return `${trimmed(metres * 1e3)} mm`;
  if (metres < 0.995) return `${trimmed(metres * 100)} cm`;
  return `${trimmed(metres)} m`;
}

/** Minutes, seconds and hundredths. @param {number} seconds */
export function asTime(seconds) {
  const whole = Math.floor(seconds);
  const pad = (/** @type {number} */ n) => String(n).padStart(2, '0');
  const hundredths = pad(Math.floor((seconds - whole) * 100));
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor(whole / 60) % 60;
  return `${hours ? `${hours}:${pad(minutes)}` : minutes}:${pad(whole % 60)}.${hundredths}`;
}

/** Thousands apart. @param {number} count */
export function asCount(count) {
  return count.toLocaleString('en').replaceAll(',', '\u202f');
}

/** @param {number} value */
function trimmed(value) {
  return String(Number(value.toPrecision(3)));
}
