import { apply } from "../geometry/pose.js";
import { constraintEnds } from "./constraint_marks.js";

const FRESH_MS = 1400;
const MOST_FRESH = 600;

/**
 * @typedef {{kind: "line"|"constraint"|"robot"|"component", id: string}} Thing
 * @typedef {import("./scene.js").Scene} Scene
 * @typedef {import("./camera.js").Camera} Camera
 * @typedef {import("../data/line_set.js").LineSet} LineSet
 * @typedef {import("../net/contract.js").LineAnswer} LineAnswer
 */

/** Walls that have just come, drawn in the accent colour until they fade into the map. */
export class FreshLines {
  constructor() {
    /** @type {LineAnswer[]} */
    this._lines = [];
    this._since = -Infinity;
  }

  /** @param {import("../data/site_state.js").SiteState|null} before @param {import("../data/site_state.js").SiteState} after */
  update(before, after) {
    if (!before || before.lines.length === 0) return;
    const fresh = newIn(after.lines, before.lines);
    // Where nearly everything is new, nothing stands out.
    if (fresh.length === 0 || fresh.length > MOST_FRESH) return;
    this._lines = fresh;
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
    for (const line of this._lines) drawLine(context, camera, scene, line, scene.palette.ink.accent, 3);
    context.globalAlpha = 1;
  }
}

/** @param {LineSet} lines @param {LineSet} before */
function newIn(lines, before) {
  if (lines.arrived && lines.predecessor === before.serial) return lines.arrived;
  const known = new Set(before.answers.map((line) => line.id));
  return lines.answers.filter((line) => !known.has(line.id));
}

/** Draw what is chosen, or pointed at, over the map. @param {CanvasRenderingContext2D} context @param {Camera} camera @param {Scene} scene @param {Thing|null} thing @param {boolean} strong */
export function drawThing(context, camera, scene, thing, strong) {
  if (!thing) return;
  if (thing.kind === "line") {
    const { lines } = scene.state;
    const line = lines.answers[lines.indexOf(thing.id)];
    if (line) drawLine(context, camera, scene, line, scene.palette.ink.accent, strong ? 5 : 3.5);
  } else if (thing.kind === "constraint") {
    drawConstraint(context, camera, scene, thing.id, strong);
  }
}

/** @param {CanvasRenderingContext2D} context @param {Camera} camera @param {Scene} scene @param {LineAnswer} line @param {string} colour @param {number} width */
function drawLine(context, camera, { placement }, line, colour, width) {
  const pose = placement.get(line.component);
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
