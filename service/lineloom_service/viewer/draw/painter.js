import { paintConstraints } from "./constraint_painter.js";
import { paintKeyframes } from "./keyframe_painter.js";
import { paintLines } from "./wall_painter.js";
import { paintPaths, paintPlaces } from "./way_painter.js";

/**
 * Draw what moves only when the map does, in steps: the generator yields after every few
 * milliseconds' worth of strokes, so that a large map is drawn over several frames.
 *
 * @param {CanvasRenderingContext2D|OffscreenCanvasRenderingContext2D} context
 * @param {import("./scene.js").Scene} scene @param {import("./scene.js").View} view
 * @param {number} [every] draw only every n-th line: for frames that must come now
 */
export function* paint(context, scene, view, every = 1) {
  context.lineCap = "round";
  context.lineJoin = "round";
  if (scene.layers.places) yield* paintPlaces(context, scene, view);
  if (scene.layers.trajectories) yield* paintPaths(context, scene, view);
  if (scene.layers.lines) yield* paintLines(context, scene, view, every);
  if (scene.layers.keyframes) yield* paintKeyframes(context, scene, view);
  yield* paintConstraints(context, scene, view);
  context.globalAlpha = 1;
  context.setLineDash([]);
}
