import { h } from "./dom.js";
import { card, facts, tag } from "./card.js";
import { checkTable } from "./check_table.js";
import { degrees, percent } from "./format.js";
import { brief } from "../data/brief.js";

/** @type {Record<string, string>} */
const MEANING = {
  unique: "The scan was taken here.",
  ambiguous: "Several places look alike: the first is only the likeliest.",
  unknown: "No place of the map fits well enough.",
};

/**
 * Where a scan was taken: ranked hypotheses.
 *
 * @param {import("../tools/localizer.js").Localizer} localizer
 * @param {import("./inspector.js").CardContext} context
 * @param {(rank: number) => void} onChoose
 */
export function localizeCard(localizer, { onClose }, onChoose) {
  const answer = /** @type {import("../net/contract.js").LocalizeAnswer} */ (localizer.answer);
  const rows = answer.hypotheses.map((hypothesis, rank) =>
    h(
      "li",
      {},
      h(
        "button",
        {
          "aria-current": String(rank === localizer.chosen),
          "data-key": `hypothesis ${rank}`,
          onclick: () => onChoose(rank),
        },
        h("span", { className: "name" }, `#${rank + 1} in ${brief(hypothesis.component)}`),
        h("span", { className: "end" }, percent(hypothesis.score)),
      ),
    ),
  );
  const chosen = answer.hypotheses[localizer.chosen];
  return card(
    `Where is ${localizer.name}?`,
    tag(answer.verdict),
    onClose,
    h("p", { className: "reason" }, MEANING[answer.verdict]),
    answer.reason && h("p", { className: "muted" }, answer.reason),
    rows.length > 0 && h("ul", { className: "rows" }, ...rows),
    chosen &&
      facts([
        ["Position", `${chosen.x.toFixed(2)}, ${chosen.y.toFixed(2)} m`],
        ["Heading", degrees(chosen.theta)],
      ]),
    chosen && Object.keys(chosen.checks ?? {}).length > 0 && checkTable(chosen.checks, chosen.limits ?? {}),
    h("p", { className: "muted" }, "Nothing was added to the map."),
  );
}
