/** Write a line of text with a rim in the paper's colour. @param {CanvasRenderingContext2D} context @param {string} text @param {number} x @param {number} y @param {string} colour @param {string} paper @param {{bold?: boolean, align?: CanvasTextAlign}} [options] */
export function drawLabel(context, text, x, y, colour, paper, { bold = false, align = "left" } = {}) {
  context.font = `${bold ? 600 : 500} 12px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif`;
  context.textAlign = align;
  context.textBaseline = "alphabetic";
  context.lineJoin = "round";
  context.lineWidth = 4;
  context.strokeStyle = paper;
  context.globalAlpha = 0.85;
  context.strokeText(text, x, y);
  context.globalAlpha = 1;
  context.fillStyle = colour;
  context.fillText(text, x, y);
}
