import { apply } from "../geometry/pose.js";
import { constraintEnds } from "./constraint_marks.js";

const FRESH_MS = 1400;
const MOST_FRESH = 600;

/**
 * @typedef {{kind: "line"|"constraint"|"robot"|"component", id: string}} Thing
 * @typedef {import("./painter.js").Scene} Scene
 * @typedef {import("./camera.js").Camera} Camera
 */

/** Walls that have just come, drawn in the accent colour until they fade into the map. */
export class FreshLines {
  constructor() {
    /** @type {Set<string>} */
    this._ids = new Set();
    this._since = -Infinity;
  }

  /** @param {import("../data/site_state.js").SiteState|null} before @param {import("../data/site_state.js").SiteState} after */
  update(before, after) {
    if (!before || before.lines.length === 0) return;
    const known = new Set(before.lines.answers.map((line) => line.id));
    const fresh = after.lines.answers.filter((line) => !known.has(line.id)).map((line) => line.id);
    // Where nearly everything is new, nothing stands out.
    if (fresh.length === 0 || fresh.length > MOST_FRESH) return;
    this._ids = new Set(fresh);
    this._since = performance.now();
  }

  get fading() {
    return performance.now() - this._since < FRESH_MS;
  }

  /** @param {CanvasRenderingContext2D} context @param {Camera} camera @param {Scene} scene */
  draw(context, camera, scene) {
    const left = 1 - (performance.now() - this._since) / FRESH_MS;
    if (left <= 0) return;
    context.globalAlpha = left;
    for (const id of this._ids) drawLine(context, camera, scene, id, scene.palette.ink.accent, 3);
    context.globalAlpha = 1;
  }
}

/** Draw what is chosen, or pointed at, over the map. @param {CanvasRenderingContext2D} context @param {Camera} camera @param {Scene} scene @param {Thing|null} thing @param {boolean} strong */
export function drawThing(context, camera, scene, thing, strong) {
  if (!thing) return;
  if (thing.kind === "line") {
    drawLine(context, camera, scene, thing.id, scene.palette.ink.accent, strong ? 5 : 3.5);
  } else if (thing.kind === "constraint") {
    drawConstraint(context, camera, scene, thing.id, strong);
  }
}

/** @param {CanvasRenderingContext2D} context @param {Camera} camera @param {Scene} scene @param {string} id @param {string} colour @param {number} width */
function drawLine(context, camera, { state, placement }, id, colour, width) {
  const line = state.lines.answers[state.lines.indexOf(id)];
  const pose = line && placement.get(line.component);
  if (!pose) return;
  const [p, q] = [apply(pose, line.x1, line.y1), apply(pose, line.x2, line.y2)];
  stroke(context, camera, [p, q], colour, width);
}

/** @param {CanvasRenderingContext2D} context @param {Camera} camera @param {Scene} scene @param {string} id @param {boolean} strong */
function drawConstraint(context, camera, { state, placement, palette }, id, strong) {
  const constraint = state.constraints.get(id);
  const ends = constraint && constraintEnds(constraint, state, placement);
  if (!ends) return;
  const colour = palette.constraint(constraint.state);
  stroke(context, camera, ends, colour, strong ? 3.5 : 3);
  for (const end of ends) {
    const { x, y } = camera.toScreen(end.x, end.y);
    context.beginPath();
    context.arc(x, y, strong ? 6 : 4.5, 0, 2 * Math.PI);
    context.fillStyle = palette.ink.paper;
    context.fill();
    context.lineWidth = 2.5;
    context.stroke();
  }
}

/** @param {CanvasRenderingContext2D} context @param {Camera} camera @param {{x: number, y: number}[]} points @param {string} colour @param {number} width */
export function stroke(context, camera, points, colour, width) {
  context.beginPath();
  points.forEach((point, i) => {
    const { x, y } = camera.toScreen(point.x, point.y);
    if (i === 0) context.moveTo(x, y);
    else context.lineTo(x, y);
  });
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.lineCap = "round";
  context.stroke();
}
