import { h, refill } from "./dom.js";
import { card, facts, part, tag } from "./card.js";
import { checkTable } from "./check_table.js";
import { evidenceDrawing } from "./evidence_drawing.js";
import { count, degrees, figure, metres, percent } from "./format.js";
import { whatIfResult } from "./what_if_result.js";
import { brief } from "../data/brief.js";

const TITLES = { sequential: "Step", loop: "Loop", rendezvous: "Rendezvous", operator: "Operator's word" };

/**
 * A constraint, its evidence, and what can be done about it.
 *
 * @param {import("../net/contract.js").ConstraintAnswer} constraint with all that is known of it
 * @param {import("./inspector.js").CardContext} context
 */
export function constraintCard(constraint, context) {
  const { T_a_b, checks, history } = constraint;
  const limits = constraint.limits ?? {};
  return card(
    `${TITLES[constraint.kind]} ${brief(constraint.id)}`,
    tag(constraint.state),
    context.onClose,
    h("p", { className: "reason", "data-state": constraint.state }, sentence(constraint.reason)),
    actions(constraint, context),
    evidenceDrawing(constraint.matched ?? [], constraint.conflicts ?? []),
    (Object.keys(checks).length > 0 || Object.keys(limits).length > 0) &&
      part("Checks", checkTable(checks, limits)),
    uniqueness(constraint),
    part(
      "Between",
      facts([
        ["Id", constraint.id],
        ["a", `${constraint.robot_a ?? "?"}, keyframe ${brief(constraint.keyframe_a)}`],
        ["b", `${constraint.robot_b ?? "?"}, keyframe ${brief(constraint.keyframe_b)}`],
        ["b seen from a", `${metres(T_a_b.x)}, ${metres(T_a_b.y)}, ${degrees(T_a_b.theta)}`],
        ["Residual in the graph", constraint.residual === null ? null : `${figure(constraint.residual)} σ`],
      ]),
    ),
    agreeing(constraint, context),
    history && history.length > 0 && part("History", h("ol", { className: "story" }, ...history.map(chapter))),
  );
}

/** @param {import("../net/contract.js").ConstraintAnswer} constraint @param {import("./inspector.js").CardContext} context */
function actions(constraint, context) {
  const result = h("div", { role: "status" });
  const { state } = constraint;
  const restoring = state === "retracted" || wasWithdrawn(constraint);
  const action = restoring ? "restore" : "retract";
  const usable = restoring || state === "accepted" || state === "candidate";
  /** @param {Event} event @param {() => Promise<any>} work */
  const run = async (event, work) => {
    const button = /** @type {HTMLButtonElement} */ (event.currentTarget);
    button.disabled = true;
    try {
      await work();
    } catch (error) {
      refill(result, h("p", { className: "health" }, /** @type {Error} */ (error).message));
    }
    button.disabled = false;
  };
  return h(
    "div",
    { className: "actions" },
    h(
      "div",
      { className: "buttons" },
      h("button", { onclick: () => context.onGoTo({ kind: "constraint", id: constraint.id }), "data-key": "go" }, "Show"),
      usable &&
        h(
          "button",
          {
            "data-key": "what-if",
            onclick: (/** @type {Event} */ event) =>
              run(event, async () => refill(result, whatIfResult(await context.onWhatIf(constraint.id)))),
          },
          // The service looks at the opposite of what is.
          `What if ${state === "retracted" ? "restored" : "retracted"}?`,
        ),
      (state === "candidate" || (state === "rejected" && !restoring)) &&
        h(
          "button",
          {
            className: "primary",
            "data-key": "confirm",
            onclick: (/** @type {Event} */ event) => run(event, () => context.onAct(constraint.id, "confirm")),
          },
          "Confirm",
        ),
      usable &&
        h(
          "button",
          {
            className: restoring ? "primary" : "danger",
            "data-key": "act",
            onclick: (/** @type {Event} */ event) => run(event, () => context.onAct(constraint.id, action)),
          },
          restoring ? "Restore" : "Retract",
        ),
    ),
    result,
  );
}

/** Whether the mapper once believed it and then no more: that can be overruled. @param {import("../net/contract.js").ConstraintAnswer} constraint */
function wasWithdrawn({ state, history = [] }) {
  return state === "rejected" && history.some((entry) => entry.state === "accepted");
}

/** @param {import("../net/contract.js").ConstraintAnswer} constraint */
function uniqueness({ votes, margin, runner_up }) {
  const given = [votes, margin, runner_up].some((value) => value !== null && value !== undefined);
  if (!given) return null;
  const rival = runner_up && `${metres(runner_up.x)}, ${metres(runner_up.y)}, ${degrees(runner_up.theta)}`;
  return part(
    "Uniqueness",
    facts([
      ["Lines that voted for it", votes === null || votes === undefined ? null : metres(votes)],
      ["Lead over the runner-up", margin === null || margin === undefined ? null : percent(margin)],
      ["Runner-up", rival ?? "none"],
      ["Speaks for that", runner_up ? metres(runner_up.evidence) : null],
    ]),
  );
}

/** @param {import("../net/contract.js").ConstraintAnswer} constraint @param {import("./inspector.js").CardContext} context */
function agreeing({ id, consistency_set }, { onPick, state }) {
  const others = consistency_set.filter((other) => other !== id);
  if (others.length === 0) return null;
  const buttons = others.map((other) =>
    state.constraints.has(other)
      ? h("button", { onclick: () => onPick({ kind: "constraint", id: other }), "data-key": `set ${other}` }, brief(other))
      : h("span", {}, other),
  );
  return part("Agrees with", h("div", { className: "buttons" }, ...buttons));
}

/** @param {{version: number, state: string, reason: string}} entry */
function chapter({ version, state, reason }) {
  return h(
    "li",
    {},
    h("span", { className: "when" }, `v ${count(version)}`),
    h("span", {}, h("strong", {}, state), reason ? ` – ${reason}` : ""),
  );
}

/** @param {string} text */
function sentence(text) {
  return text ? text[0].toUpperCase() + text.slice(1) : "No reason given.";
}
