import { constraintEnds } from "./constraint_marks.js";

/** @type {Record<string, number[]>} */
const DASHES = { candidate: [6, 4], rejected: [2, 4], retracted: [8, 3, 2, 3] };

/**
 * @typedef {import("./scene.js").Scene} Scene
 * @typedef {import("./scene.js").View} View
 */

/** @param {any} context @param {Scene} scene @param {View} view */
export function* paintConstraints(context, scene, view) {
  const { state, placement, palette, layers } = scene;
  let count = 0;
  for (const constraint of state.constraints.values()) {
    if (!layers[constraint.state]) continue;
    const ends = constraintEnds(constraint, state, placement);
    if (!ends) continue;
    styleConstraint(context, palette, constraint.state, constraint.kind);
    context.beginPath();
    for (const [i, { x, y }] of ends.entries()) {
      const px = view.width / 2 + (x - view.x) * view.scale;
      const py = view.height / 2 - (y - view.y) * view.scale;
      if (i === 0) context.moveTo(px, py);
      else context.lineTo(px, py);
    }
    context.stroke();
    count += 1;
    if (count % 300 === 0) yield;
  }
  context.setLineDash([]);
  context.globalAlpha = 1;
}

/** @param {any} context @param {import("./palette.js").Palette} palette @param {string} state @param {string} kind */
function styleConstraint(context, palette, state, kind) {
  context.strokeStyle = palette.constraint(state);
  context.lineWidth = kind !== "loop" ? 1.8 : 1.1;
  context.globalAlpha = state === "accepted" ? 0.8 : 0.7;
  context.setLineDash(DASHES[state] ?? []);
}
