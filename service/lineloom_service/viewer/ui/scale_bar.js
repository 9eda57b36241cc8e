import { roundLength } from "../draw/grid_marks.js";

/** Show how long a round length is on the screen. @param {HTMLElement} element @param {number} scale pixels per metre */
export function showScale(element, scale) {
  const metres = roundLength(64 / scale);
  element.style.width = `${metres * scale}px`;
  const text = metres >= 1 ? `${metres} m` : `${Math.round(100 * metres)} cm`;
  if (element.textContent !== text) element.textContent = text;
}
