import { h, refill } from "./dom.js";
import { card } from "./card.js";
import { componentCard } from "./component_card.js";
import { constraintCard } from "./constraint_card.js";
import { lineCard } from "./line_card.js";
import { robotCard } from "./robot_card.js";

/**
 * @typedef {import("../draw/highlight_marks.js").Thing} Thing
 * @typedef {{state: import("../data/site_state.js").SiteState,
 *   palette: import("../draw/palette.js").Palette,
 *   onClose: () => void, onPick: (thing: Thing) => void, onGoTo: (thing: Thing) => void,
 *   onAct: (id: string, action: "retract"|"restore"|"confirm") => Promise<void>,
 *   onWhatIf: (id: string) => Promise<import("../net/contract.js").WhatIfAnswer>,
 *   onJoin: (component: string) => void,
 *   onDownload: (path: string, name: string) => void}} CardContext
 */

/** The panel that tells of what is chosen. */
export class Inspector {
  /**
   * @param {HTMLElement} element
   * @param {(id: string) => Promise<import("../net/contract.js").ConstraintAnswer>} evidence
   */
  constructor(element, evidence) {
    this._element = element;
    this._evidence = evidence;
    this._shown = "";
    /** @type {import("../net/contract.js").ConstraintAnswer|null} */
    this._detail = null;
  }

  close() {
    this._element.hidden = true;
    this._shown = "";
    this._detail = null;
    refill(this._element);
  }

  /** Show a card that is made elsewhere. @param {Node} content */
  open(content) {
    this._shown = "";
    this._element.hidden = false;
    refill(this._element, content);
  }

  /** Show a thing of the state as it is now. @param {Thing} thing @param {CardContext} context */
  async show(thing, context) {
    const content = this._card(thing, context);
    // A card that has not changed stays: with it what-if's answer and the reader's place in it.
    const key = `${thing.kind} ${thing.id} ${fingerprint(thing, context.state)}`;
    if (key === this._shown) return;
    const another = !this._shown.startsWith(`${thing.kind} ${thing.id} `);
    this._shown = key;
    if (another) this._detail = null;
    this._element.hidden = false;
    refill(this._element, content);
    if (another) this._element.scrollTop = 0;
    if (thing.kind === "constraint") await this._addEvidence(thing.id, key, context);
  }

  /** @param {string} id @param {string} key @param {CardContext} context */
  async _addEvidence(id, key, context) {
    const detail = await this._evidence(id).catch(() => null);
    if (!detail || this._shown !== key) return;
    this._detail = detail;
    refill(this._element, constraintCard(detail, context));
  }

  /** @param {Thing} thing @param {CardContext} context */
  _card(thing, context) {
    const { state } = context;
    if (thing.kind === "line") {
      const line = state.lines.answers[state.lines.indexOf(thing.id)];
      if (line) return lineCard(line, context);
    } else if (thing.kind === "robot") {
      const robot = state.robot(thing.id);
      if (robot) return robotCard(robot, context);
    } else if (thing.kind === "component") {
      const component = state.component(state.survivorOf(thing.id));
      if (component) return componentCard(component, context);
    } else {
      const constraint = state.constraints.get(thing.id);
      if (constraint) return constraintCard({ ...this._kept(thing.id), ...constraint }, context);
    }
    const gone = `This ${thing.kind === "line" ? "wall" : thing.kind} is not in the map shown.`;
    return card(thing.id, null, context.onClose, h("p", { className: "muted" }, gone));
  }

  /** What was learnt of a constraint, until it is asked for again. @param {string} id */
  _kept(id) {
    return this._detail?.id === id ? this._detail : {};
  }
}

/** Changes whenever the card of a thing would. @param {Thing} thing @param {import("../data/site_state.js").SiteState} state */
function fingerprint(thing, state) {
  if (thing.kind === "line") return JSON.stringify(state.lines.answers[state.lines.indexOf(thing.id)] ?? null);
  if (thing.kind === "robot") return JSON.stringify(state.robot(thing.id) ?? null);
  if (thing.kind === "component") return `${state.version}`;
  const constraint = state.constraints.get(thing.id);
  return constraint ? `${constraint.state} ${constraint.reason} ${constraint.consistency_set.join()}` : "";
}
