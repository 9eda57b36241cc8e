import { toPixels } from "./pixels.js";

/**
 * @typedef {import("./scene.js").Scene} Scene
 * @typedef {import("./scene.js").View} View
 */

/** @param {any} context @param {Scene} scene @param {View} view */
export function* paintKeyframes(context, { state, placement, palette }, view) {
  const radius = Math.min(Math.max(0.05 * view.scale, 1.2), 4);
  const tick = Math.max(0.18 * view.scale, 2 * radius);
  const heading = view.scale > 25;
  let count = 0;
  for (const node of state.keyframes.values()) {
    const pose = placement.get(node.component);
    if (!pose) continue;
    const { a, b, tx, ty } = toPixels(pose, view);
    const x = a * node.x - b * node.y + tx;
    const y = -b * node.x - a * node.y + ty;
    if (x < -9 || y < -9 || x > view.width + 9 || y > view.height + 9) continue;
    context.fillStyle = palette.robot(state.robotNames.indexOf(node.robot));
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fill();
    if (heading) {
      const angle = pose.theta + node.theta;
      context.strokeStyle = context.fillStyle;
      context.lineWidth = 1;
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x + tick * Math.cos(angle), y - tick * Math.sin(angle));
      context.stroke();
    }
    count += 1;
    if (count % 300 === 0) yield;
  }
}
