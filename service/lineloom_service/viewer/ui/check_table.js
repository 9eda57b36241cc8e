import { h } from "./dom.js";
import { degrees, figure, metres, percent } from "./format.js";

/** @type {Record<string, (value: number) => string>} unit -> how people read it; others as they are */
const WRITTEN = { m: metres, rad: degrees, share: percent };

/**
 * The figures against their thresholds.
 *
 * @param {Object<string, number|null>} checks
 * @param {Object<string, import("../net/contract.js").Limit>} limits
 */
export function checkTable(checks, limits) {
  const names = [...new Set([...Object.keys(limits), ...Object.keys(checks)])];
  const judged = Object.values(limits).some(decides);
  const weighed = Object.values(limits).some((limit) => typeof limit.log_odds === "number");
  const head = h(
    "tr",
    {},
    h("th", { scope: "col" }, hidden("Check")),
    h("th", { scope: "col" }, "Figure"),
    judged && h("th", { scope: "col" }, "Needed"),
    judged && h("th", { scope: "col" }, hidden("Holds")),
    weighed && h("th", { scope: "col", title: "What it adds to the log-odds that this is false" }, "Doubt"),
  );
  const rows = names.map((name) => row(name, checks[name], limits[name], judged, weighed));
  return h("table", { className: "checks" }, h("thead", {}, head), h("tbody", {}, ...rows));
}

/** @param {string} name @param {number|null|undefined} value @param {import("../net/contract.js").Limit|undefined} limit @param {boolean} judged @param {boolean} weighed */
function row(name, value, limit, judged, weighed) {
  const words = limit?.means || name.replaceAll("_", " ");
  const write = writer(limit?.unit ?? "");
  const held = !limit || !decides(limit) ? "" : limit.holds ? "held" : "failed";
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
    weighed && h("td", { className: "muted" }, odds(limit?.log_odds)),
  );
}

/** @param {number|null|undefined} logOdds */
function odds(logOdds) {
  return typeof logOdds === "number" ? `${logOdds < 0 ? "−" : "+"}${Math.abs(logOdds).toFixed(1)}` : "";
}

/** Whether the figure is held to anything, or only shown. @param {import("../net/contract.js").Limit} limit */
function decides({ at_least, at_most }) {
  return at_least !== null || at_most !== null;
}

/** @param {string} unit @returns {(value: number) => string} */
function writer(unit) {
  return WRITTEN[unit] ?? ((value) => `${figure(value)} ${unit}`.trim());
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
