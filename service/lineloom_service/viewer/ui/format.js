/** Return a count with thin separators. @param {number} value */
export function count(value) {
  return value.toLocaleString("en");
}

/** @param {number} value */
export function metres(value) {
  if (Math.abs(value) >= 100) return `${count(Math.round(value))} m`;
  if (value === 0) return "0 m";
  return Math.abs(value) < 1 ? `${(100 * value).toFixed(1)} cm` : `${value.toFixed(2)} m`;
}

/** @param {number} radians */
export function degrees(radians) {
  return `${((180 / Math.PI) * radians).toFixed(1)}°`;
}

/** @param {number} share */
export function percent(share) {
  return `${(100 * share).toFixed(share < 0.1 ? 1 : 0)} %`;
}

/** Return a figure in about three digits. @param {number} value */
export function figure(value) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1000) return count(Math.round(value));
  if (size >= 0.001) return String(Number(value.toPrecision(3)));
  return value.toExponential(1);
}

/**
 * Return a stamp as the time of day where it can be one, else as seconds: robots' clocks may count
 * from anywhere.
 *
 * @param {number} seconds
 */
export function stamp(seconds) {
  const sinceEpoch = seconds > 946684800; // 2000-01-01
  if (!sinceEpoch) return `${seconds.toFixed(1)} s`;
  return new Date(1000 * seconds).toISOString().replace("T", " ").slice(0, 19);
}

/** Return a time of the page's own clock. @param {number} milliseconds */
export function timeOfDay(milliseconds) {
  return new Date(milliseconds).toLocaleTimeString("en-GB");
}

/** Return "1 wall", "2 walls". @param {number} number @param {string} noun */
export function plural(number, noun) {
  return `${count(number)} ${noun}${number === 1 ? "" : "s"}`;
}
