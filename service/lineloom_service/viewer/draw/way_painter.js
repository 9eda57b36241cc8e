import { polyline, toPixels } from "./pixels.js";

/**
 * @typedef {import("./scene.js").Scene} Scene
 * @typedef {import("./scene.js").View} View
 */

/** @param {any} context @param {Scene} scene @param {View} view */
export function* paintPaths(context, { state, placement, palette }, view) {
  context.lineWidth = 1.5;
  context.globalAlpha = 0.55;
  for (const path of state.paths) {
    const pose = placement.get(path.component);
    if (!pose) continue;
    context.strokeStyle = palette.robot(state.robotNames.indexOf(path.robot));
    context.beginPath();
    polyline(context, path.points, toPixels(pose, view));
    context.stroke();
    yield;
  }
  context.globalAlpha = 1;
}

/** A place is a band along its keyframes. @param {any} context @param {Scene} scene @param {View} view */
export function* paintPlaces(context, { state, placement, palette }, view) {
  context.globalAlpha = 0.13;
  context.lineWidth = Math.max(0.9 * view.scale, 5);
  for (const place of state.places) {
    const nodes = place.keyframes.map((id) => state.keyframes.get(id)).filter((n) => n);
    const pose = placement.get(nodes[0]?.component ?? "");
    if (!pose) continue;
    context.strokeStyle = palette.robot(state.robotNames.indexOf(place.robot));
    context.beginPath();
    const points = nodes.flatMap((node) => [node?.x ?? 0, node?.y ?? 0]);
    polyline(context, Float32Array.from(points), toPixels(pose, view));
    context.stroke();
    yield;
  }
  context.globalAlpha = 1;
}
