import { stroke } from "./highlight_marks.js";

/**
 * Where map and floor plan differ, drawn over a map that is shown in the plan's coordinates.
 *
 * @typedef {import("../net/contract.js").PlanPiece} PlanPiece
 */
export class DifferenceMarks {
  constructor() {
    /** @type {{missing: PlanPiece[], new: PlanPiece[]}|null} */
    this.found = null;
  }

  /** @param {CanvasRenderingContext2D} context @param {import("./camera.js").Camera} camera @param {import("./scene.js").Scene} scene */
  draw(context, camera, { palette }) {
    if (!this.found) return;
    context.setLineDash([6, 4]);
    this._drawPieces(context, camera, this.found.missing, palette.constraint("rejected"));
    context.setLineDash([]);
    this._drawPieces(context, camera, this.found.new, palette.ink.accent);
  }

  /** @param {CanvasRenderingContext2D} context @param {import("./camera.js").Camera} camera @param {PlanPiece[]} pieces @param {string} colour */
  _drawPieces(context, camera, pieces, colour) {
    for (const { x1, y1, x2, y2 } of pieces) {
      stroke(context, camera, [{ x: x1, y: y1 }, { x: x2, y: y2 }], colour, 4);
    }
  }
}
