/** Least distance between two lines [px]. */
const LEAST_PX = 28;

/**
 * Draw a metric grid, every fifth line stronger.
 *
 * @param {CanvasRenderingContext2D} context @param {import("./camera.js").Camera} camera
 * @param {import("./palette.js").Palette} palette
 */
export function drawGrid(context, camera, palette) {
  const step = roundLength(LEAST_PX / camera.scale);
  const first = camera.toWorld(0, camera.height);
  const last = camera.toWorld(camera.width, 0);
  for (const strong of [false, true]) {
    context.strokeStyle = strong ? palette.ink.gridStrong : palette.ink.grid;
    context.lineWidth = 1;
    context.beginPath();
    for (let i = Math.ceil(first.x / step); i <= last.x / step; i++) {
      if ((i % 5 === 0) !== strong) continue;
      const x = Math.round(camera.toScreen(i * step, 0).x) + 0.5;
      context.moveTo(x, 0);
      context.lineTo(x, camera.height);
    }
    for (let i = Math.ceil(first.y / step); i <= last.y / step; i++) {
      if ((i % 5 === 0) !== strong) continue;
      const y = Math.round(camera.toScreen(0, i * step).y) + 0.5;
      context.moveTo(0, y);
      context.lineTo(camera.width, y);
    }
    context.stroke();
  }
}

/** Return the least of 1, 2, 5 times a power of ten that is not below a length. @param {number} metres */
export function roundLength(metres) {
  const power = 10 ** Math.floor(Math.log10(metres));
  return [1, 2, 5, 10].map((f) => f * power).find((l) => l >= metres * (1 - 1e-9)) ?? 10 * power;
}
