/** A file that holds no scan: the message says why. */
export class ScanFileError extends Error {}

/**
 * @typedef {{angle_min: number, angle_increment: number, range_min: number, range_max: number,
 *   ranges: (number|string|null)[]}} Scan
 */

/**
 * Return what to send and the last scan of it, from a file's text: a scan, `{"scans": [...]}`, or
 * one scan a line.
 *
 * @param {string} text @returns {{body: any, scans: Scan[]}}
 */
export function readScanFile(text) {
  const value = parse(text);
  const scans = Array.isArray(value) ? value : Array.isArray(value?.scans) ? value.scans : [value];
  if (scans.length === 0) throw new ScanFileError("the file holds no scan");
  scans.forEach((/** @type {any} */ scan, /** @type {number} */ index) => {
    const which = scans.length > 1 ? `scan ${index + 1}: ` : "";
    if (typeof scan !== "object" || scan === null) throw new ScanFileError(`${which}not an object`);
    if (!Array.isArray(scan.ranges)) throw new ScanFileError(`${which}"ranges" is missing`);
    for (const field of ["angle_min", "angle_increment", "range_min", "range_max"]) {
      if (typeof scan[field] !== "number") throw new ScanFileError(`${which}"${field}" is missing`);
    }
  });
  const whole = scans.map((/** @type {any} */ scan, /** @type {number} */ i) => ({ seq: i, stamp: i, ...scan }));
  return { body: whole.length === 1 ? whole[0] : { scans: whole }, scans: whole };
}

/** @param {string} text */
function parse(text) {
  try {
    return JSON.parse(text);
  } catch (error) {
    const lines = text.split("\n").filter((line) => line.trim() !== "");
    if (lines.length > 1) {
      try {
        return lines.map((line) => JSON.parse(line));
      } catch {
        // It is no list of lines either: tell of the first error.
      }
    }
    throw new ScanFileError(`not JSON: ${/** @type {Error} */ (error).message}`);
  }
}

/** Return the scan's points in the laser's frame [m], x and y by turns. @param {Scan} scan */
export function scanPoints(scan) {
  const points = [];
  for (const [i, range] of scan.ranges.entries()) {
    if (typeof range !== "number" || range < scan.range_min || range >= scan.range_max) continue;
    const angle = scan.angle_min + i * scan.angle_increment;
    points.push(range * Math.cos(angle), range * Math.sin(angle));
  }
  return Float32Array.from(points);
}
