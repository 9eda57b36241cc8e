import { apply, compose } from "../geometry/pose.js";
import { drawArrow, drawEllipse } from "../draw/robot_marks.js";
import { drawLabel } from "../draw/label.js";
import { readScanFile, scanPoints } from "./scan_file.js";

/** Asks where a scan was taken, and draws the answer over the map. Adds nothing to the map. */
export class Localizer {
  /** @param {import("../net/api.js").Api} api */
  constructor(api) {
    this._api = api;
    /** @type {import("../net/contract.js").LocalizeAnswer|null} */
    this.answer = null;
    /** Name of the file that was asked for. */
    this.name = "";
    /** Rank of the hypothesis that is shown. */
    this.chosen = 0;
    this._points = new Float32Array();
  }

  /** Show no answer any more. */
  clear() {
    this.answer = null;
    this.name = "";
    this.chosen = 0;
    this._points = new Float32Array();
  }

  /** @param {string} site @param {File} file */
  async ask(site, file) {
    this.clear();
    const { body, scans } = readScanFile(await file.text());
    this.answer = await this._api.post(`v1/sites/${encodeURIComponent(site)}/localize`, body);
    this.name = file.name;
    // Of several scans, the answer names the one that its poses are of.
    this._points = scanPoints(scans[this.answer?.scan ?? scans.length - 1]);
  }

  /** @param {CanvasRenderingContext2D} context @param {import("../draw/camera.js").Camera} camera @param {import("../draw/scene.js").Scene} scene */
  draw(context, camera, { placement, palette }) {
    this.answer?.hypotheses.forEach((hypothesis, rank) => {
      const component = placement.get(hypothesis.component);
      if (!component) return;
      const pose = compose(component, hypothesis);
      const point = camera.toScreen(pose.x, pose.y);
      const chosen = rank === this.chosen;
      const colour = chosen ? palette.ink.accent : palette.ink.muted;
      if (chosen) this._drawPoints(context, camera, pose, colour);
      drawEllipse(context, camera, point, hypothesis.covariance, component.theta, colour);
      drawArrow(context, point, pose.theta, colour, palette.ink.paper, chosen);
      drawLabel(context, `#${rank + 1}`, point.x + 13, point.y - 10, colour, palette.ink.paper, { bold: true });
    });
  }

  /** @param {CanvasRenderingContext2D} context @param {import("../draw/camera.js").Camera} camera @param {import("../geometry/pose.js").Pose} pose @param {string} colour */
  _drawPoints(context, camera, pose, colour) {
    context.fillStyle = colour;
    for (let i = 0; i < this._points.length; i += 2) {
      const at = apply(pose, this._points[i], this._points[i + 1]);
      const { x, y } = camera.toScreen(at.x, at.y);
      context.fillRect(x - 1.5, y - 1.5, 3, 3);
    }
  }
}
