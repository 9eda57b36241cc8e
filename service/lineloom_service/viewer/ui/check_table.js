import { h } from "./dom.js";
import { degrees, figure, metres, percent } from "./format.js";

/** @type {Record<string, [string, (value: number) => string]>} check -> its name and how to write it */
export const CHECKS = {
  matched: ["Points in common", figure],
  conflict: ["Points in free space", figure],
  conflict_share: ["Share in free space", percent],
  own_conflict: ["Clutter of the places", percent],
  missing_share: ["Missing of what stood still", percent],
  fit: ["Fit", figure],
  information: ["Information", figure],
  isotropy: ["Isotropy", figure],
  overlap: ["Common wall", metres],
  evidence: ["Evidence", metres],
  margin: ["Margin to runner-up", percent],
  set_size: ["Constraints that agree", figure],
  set_evidence: ["Their evidence", metres],
  set_missing: ["Missing over all of them", percent],
  set_doubt: ["The same, if three things more were", percent],
  map_missing: ["Missing wherever the maps overlap", percent],
  set_distinctive: ["Of them, from places unlike others", figure],
  rival_evidence: ["Evidence of a rival set", metres],
  moved_m: ["Moved by the closure", metres],
  turned_rad: ["Turned by the closure", degrees],
};

/**
 * The figures against their thresholds.
 *
 * @param {Object<string, number|null>} checks
 * @param {Object<string, import("../net/contract.js").Limit>} limits
 */
export function checkTable(checks, limits) {
  const names = [...new Set([...Object.keys(limits), ...Object.keys(checks)])];
  const judged = Object.keys(limits).length > 0;
  const head = h(
    "tr",
    {},
    h("th", { scope: "col" }, hidden("Check")),
    h("th", { scope: "col" }, "Figure"),
    judged && h("th", { scope: "col" }, "Needed"),
    judged && h("th", { scope: "col" }, hidden("Holds")),
  );
  const rows = names.map((name) => row(name, checks[name], limits[name], judged));
  return h("table", { className: "checks" }, h("thead", {}, head), h("tbody", {}, ...rows));
}

/** @param {string} name @param {number|null|undefined} value @param {import("../net/contract.js").Limit|undefined} limit @param {boolean} judged */
function row(name, value, limit, judged) {
  const [words, write] = CHECKS[name] ?? [name.replaceAll("_", " "), figure];
  const held = limit === undefined ? "" : limit.holds ? "held" : "failed";
  const sign = { held: "✓", failed: "✗", "": "" }[held];
  return h(
    "tr",
    {},
    h("th", { scope: "row" }, words),
    h("td", { className: held === "failed" ? "failed" : "" }, value === null || value === undefined ? "–" : write(value)),
    judged && h("td", { className: "muted" }, limit ? needed(limit, write) : ""),
    judged &&
      h(
        "td",
        { className: `sign ${held}` },
        h("span", { "aria-hidden": "true" }, sign),
        held && hidden(held === "held" ? "holds" : "does not hold"),
      ),
  );
}

/** Return words for screen readers alone. @param {string} words */
function hidden(words) {
  return h("span", { className: "hidden-text" }, words);
}

/** @param {import("../net/contract.js").Limit} limit @param {(value: number) => string} write */
function needed({ at_least, at_most }, write) {
  const parts = [];
  if (at_least !== null) parts.push(`≥ ${write(at_least)}`);
  if (at_most !== null) parts.push(`≤ ${write(at_most)}`);
  return parts.join(", ");
}
