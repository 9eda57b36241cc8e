import { framesOf } from "../data/frames.js";
import { DifferenceMarks } from "../draw/difference_marks.js";
import { ProblemError } from "../net/api.js";
import { FloorPlan } from "../net/floor_plan.js";
import { brief } from "../data/brief.js";

/**
 * Shows the map in the coordinates that the reader has chosen, for a site until the tab is closed.
 *
 * @typedef {import("../data/frames.js").FrameChoice} Choice
 */
export class FrameControl {
  /** @param {import("../app.js").App} app */
  constructor(app) {
    this._app = app;
    /** @type {Choice} */
    this.choice = "map";
    /** @type {import("../net/contract.js").FloorPlanAnswer|null} */
    this._plan = null;
    this._asking = false;
    this.marks = new DifferenceMarks();
    app.view.framesFor = (state) => framesOf(this.choice, state, this._plan, app.view.frames);
  }

  /** A site was opened: what was chosen for it before a reload holds. */
  open() {
    this._plan = null;
    this.marks.found = null;
    this.choice = this._app.preferences.get(this._key) ?? "map";
    this._app.panel.frames.show(this.choice);
  }

  /** @param {Choice} choice */
  async choose(choice) {
    this.choice = choice;
    this.marks.found = null;
    this._app.preferences.set(this._key, choice);
    if (choice === "plan") await this.follow();
    this._app.panel.frames.show(this.choice);
    this._show();
  }

  /** The map has grown, and its place in the plan may have moved. */
  async follow() {
    if (this.choice !== "plan" || this._asking) return;
    this._asking = true;
    const site = this._app.site;
    const source = new FloorPlan(this._app.api, `v1/sites/${encodeURIComponent(site)}`);
    try {
      const plan = await source.places();
      const found = await source.differences(plan);
      if (this._app.site !== site) return;
      this._tell(plan);
      const before = JSON.stringify(this._plan?.components);
      this._plan = plan;
      this.marks.found = found;
      if (JSON.stringify(plan.components) !== before) this._show();
    } catch (error) {
      this._giveUp(error);
    } finally {
      this._asking = false;
    }
  }

  /** What asks the service for files in the same coordinates. */
  get query() {
    return { map: "", walls: "&align=true", plan: "&frame=plan" }[this.choice];
  }

  get _key() {
    return `frame ${this._app.site}`;
  }

  /** Show the same state anew: components glide to their places. */
  _show() {
    const { view } = this._app;
    if (view.state) view.show(view.state);
  }

  /** Say of what has no place why, once. @param {import("../net/contract.js").FloorPlanAnswer} plan */
  _tell(plan) {
    if (this._plan) return;
    for (const { component, T_plan_map, reason } of plan.components) {
      if (!T_plan_map) this._app.notices.say(`${brief(component)} has no place in the plan: ${reason}`);
    }
  }

  /** @param {unknown} error */
  _giveUp(error) {
    const none = error instanceof ProblemError && error.status === 404;
    const words = none
      ? `${this._app.site} has no floor plan yet: lineloom floorplan put FILE`
      : String(/** @type {Error} */ (error).message);
    this._app.notices.say(words, none ? "" : "bad");
    if (!none) return;
    this.choice = "map";
    this._app.preferences.set(this._key, "map");
    this._app.panel.frames.show("map");
    this._show();
  }
}
