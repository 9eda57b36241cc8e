import { apply, wrap } from "../geometry/pose.js";
import { positionEllipse } from "../geometry/ellipse.js";
import { drawLabel } from "./label.js";

const GLIDE_MS = 320;

/** Draws the robots where they are, and lets them glide there from where they were. */
export class RobotMarks {
  constructor() {
    /** @type {Map<string, {component: string, x: number, y: number, theta: number, since: number}>} */
    this._from = new Map();
    /** @type {import("../net/contract.js").RobotAnswer[]} */
    this._robots = [];
  }

  /** Take new poses. @param {import("../net/contract.js").RobotAnswer[]} robots */
  update(robots) {
    const now = performance.now();
    for (const robot of this._robots) {
      const shown = this.poseOf(robot);
      if (shown) this._from.set(robot.robot, { ...shown, component: robot.component ?? "", since: now });
    }
    this._robots = robots;
  }

  /** Whether a robot is still on its way. */
  get moving() {
    const now = performance.now();
    return this._robots.some((r) => now - (this._from.get(r.robot)?.since ?? -Infinity) < GLIDE_MS);
  }

  /** Return the pose at which a robot is shown now. @param {import("../net/contract.js").RobotAnswer} robot */
  poseOf(robot) {
    if (!robot.pose) return null;
    const { x, y, theta } = robot.pose;
    const from = this._from.get(robot.robot);
    const share = from ? (performance.now() - from.since) / GLIDE_MS : 1;
    // A jump of metres is a correction, not a drive.
    if (!from || share >= 1 || from.component !== robot.component || Math.hypot(x - from.x, y - from.y) > 5) {
      return { x, y, theta };
    }
    return {
      x: from.x + share * (x - from.x),
      y: from.y + share * (y - from.y),
      theta: from.theta + share * wrap(theta - from.theta),
    };
  }

  /**
   * @param {CanvasRenderingContext2D} context @param {import("./camera.js").Camera} camera
   * @param {import("./scene.js").Scene} scene @param {string} selected
   */
  draw(context, camera, { state, placement, palette, layers }, selected) {
    for (const robot of this._robots) {
      const pose = this.poseOf(robot);
      const component = placement.get(robot.component ?? "");
      if (!pose || !component) continue;
      const at = apply(component, pose.x, pose.y);
      const point = camera.toScreen(at.x, at.y);
      const colour = palette.robot(state.robotNames.indexOf(robot.robot));
      if (layers.ellipses) {
        drawEllipse(context, camera, point, robot.pose?.covariance, component.theta, colour);
      }
      if (!layers.robots) continue;
      drawArrow(context, point, component.theta + pose.theta, colour, palette.ink.paper, robot.robot === selected);
      const note = robot.state === "lost" || robot.state === "silent" ? ` · ${robot.state}` : robot.health.length > 0 ? " · !" : "";
      drawLabel(context, robot.robot + note, point.x + 13, point.y - 10, colour, palette.ink.paper, { bold: true });
    }
  }
}

/** @param {CanvasRenderingContext2D} context @param {import("./camera.js").Camera} camera @param {{x: number, y: number}} point @param {any} covariance @param {number} turn @param {string} colour */
export function drawEllipse(context, camera, point, covariance, turn, colour) {
  const ellipse = positionEllipse(covariance);
  if (!ellipse) return;
  context.beginPath();
  const [major, minor] = [ellipse.major * camera.scale, ellipse.minor * camera.scale];
  context.ellipse(point.x, point.y, Math.max(major, 1), Math.max(minor, 1), -(ellipse.angle + turn), 0, 2 * Math.PI);
  context.fillStyle = colour;
  context.strokeStyle = colour;
  context.lineWidth = 1.2;
  context.globalAlpha = 0.14;
  context.fill();
  context.globalAlpha = 0.75;
  context.stroke();
  context.globalAlpha = 1;
}

/** @param {CanvasRenderingContext2D} context @param {{x: number, y: number}} point @param {number} angle @param {string} colour @param {string} paper @param {boolean} ringed */
export function drawArrow(context, point, angle, colour, paper, ringed) {
  context.save();
  context.translate(point.x, point.y);
  if (ringed) {
    context.beginPath();
    context.arc(0, 0, 15, 0, 2 * Math.PI);
    context.strokeStyle = colour;
    context.lineWidth = 2;
    context.stroke();
  }
  context.rotate(-angle);
  context.beginPath();
  context.moveTo(11, 0);
  context.lineTo(-7, 7);
  context.lineTo(-3.5, 0);
  context.lineTo(-7, -7);
  context.closePath();
  context.lineJoin = "round";
  context.lineWidth = 4;
  context.strokeStyle = paper;
  context.stroke();
  context.fillStyle = colour;
  context.fill();
  context.restore();
}
