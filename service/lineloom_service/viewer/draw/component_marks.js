import { apply } from "../geometry/pose.js";
import { drawLabel } from "./label.js";
import { brief } from "../data/brief.js";

/**
 * Frame and name each component while there are several: nothing is known of how they lie to each
 * other.
 *
 * @param {CanvasRenderingContext2D} context @param {import("./camera.js").Camera} camera
 * @param {import("./scene.js").Scene} scene @param {string} selected
 */
export function drawComponents(context, camera, { state, placement, palette }, selected) {
  if (state.components.length < 2) return;
  for (const component of state.components) {
    const pose = placement.get(component.id);
    if (!pose || component.bounds.isEmpty) continue;
    const { xMin, yMin, xMax, yMax } = component.bounds.grown(0.8);
    const corners = [
      [xMin, yMax],
      [xMax, yMax],
      [xMax, yMin],
      [xMin, yMin],
    ].map(([x, y]) => apply(pose, x, y));
    const points = corners.map(({ x, y }) => camera.toScreen(x, y));
    context.beginPath();
    points.forEach(({ x, y }, i) => (i === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
    context.closePath();
    const chosen = component.id === selected;
    context.strokeStyle = chosen ? palette.ink.accent : palette.ink.frame;
    context.lineWidth = chosen ? 1.6 : 1;
    context.setLineDash([3, 4]);
    context.stroke();
    context.setLineDash([]);
    const name = `${brief(component.id)} · ${component.robots.join(", ")}`;
    drawLabel(context, name, points[0].x + 2, points[0].y - 7, palette.ink.muted, palette.ink.paper);
  }
}
