import { Bounds } from "../geometry/bounds.js";
import { h, svg } from "./dom.js";

const MOST_CONFLICTS = 1500;

/**
 * The two places laid over each other: matched lines in two colours, tied where they belong
 * together, and the points of one that stand in the other's free space.
 *
 * @param {import("../net/contract.js").MatchedPair[]} matched
 * @param {number[][]} conflicts
 */
export function evidenceDrawing(matched, conflicts) {
  const bounds = new Bounds();
  for (const { reference, current } of matched) {
    for (const [x1, y1, x2, y2] of [reference, current]) {
      bounds.add(x1, y1);
      bounds.add(x2, y2);
    }
  }
  for (const [x, y] of conflicts) bounds.add(x, y);
  if (bounds.isEmpty) return null;
  const box = bounds.grown(0.06 * Math.max(bounds.width, bounds.height, 1));
  const unit = Math.max(box.width / 320, box.height / 230);
  const marks = [
    ...matched.map(({ reference }) => segment(reference, "reference", 4.5 * unit, 0.32)),
    ...matched.map(({ reference, current }) => tie(reference, current, unit)),
    ...matched.map(({ current }) => segment(current, "current", 1.8 * unit, 1)),
    ...conflicts.slice(0, MOST_CONFLICTS).map(([x, y]) =>
      svg("circle", { cx: x, cy: -y, r: 1.7 * unit, class: "conflict" }),
    ),
  ];
  const words = `${matched.length} pairs of matched lines, ${conflicts.length} points in conflict`;
  const drawing = svg(
    "svg",
    {
      viewBox: `${box.xMin} ${-box.yMax} ${box.width} ${box.height}`,
      role: "img",
      "aria-label": words,
    },
    ...marks,
  );
  return h(
    "figure",
    { className: "evidence" },
    drawing,
    h(
      "figcaption",
      {},
      h("span", { className: "key" }, "place a"),
      h("span", { className: "key", "data-of": "current" }, "place b, laid over it"),
      h("span", { className: "key", "data-of": "conflict" }, `in free space: ${conflicts.length}`),
    ),
  );
}

/** @param {number[]} ends @param {string} of @param {number} width @param {number} opacity */
function segment([x1, y1, x2, y2], of, width, opacity) {
  return svg("line", {
    x1,
    y1: -y1,
    x2,
    y2: -y2,
    class: of,
    "stroke-width": width,
    "stroke-opacity": opacity,
    "stroke-linecap": "round",
  });
}

/** @param {number[]} a @param {number[]} b @param {number} unit */
function tie(a, b, unit) {
  return svg("line", {
    x1: (a[0] + a[2]) / 2,
    y1: -(a[1] + a[3]) / 2,
    x2: (b[0] + b[2]) / 2,
    y2: -(b[1] + b[3]) / 2,
    class: "tie",
    "stroke-width": unit,
  });
}
