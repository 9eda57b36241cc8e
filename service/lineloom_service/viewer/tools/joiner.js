import { apply, compose, inverse } from "../geometry/pose.js";

/** Keyframes of a component that are held against another's. */
const MOST_COMPARED = 1500;
const QUARTER = Math.PI / 12;

/**
 * Laying one component on another by hand, and asking what that would come to.
 *
 * @typedef {import("../geometry/pose.js").Pose} Pose
 * @typedef {import("../data/site_state.js").Keyframe} Keyframe
 * @typedef {import("../net/contract.js").JoinTrialAnswer} JoinTrialAnswer
 * @typedef {{component_a: string, component_b: string, body: any}} Said
 */
export class Joiner {
  /** @param {import("../app.js").App} app @param {() => void} onChange */
  constructor(app, onChange) {
    this._app = app;
    this._onChange = onChange;
    this.active = false;
    /** The component that is being laid elsewhere. */
    this.component = "";
    /** @type {Said|null} */
    this.said = null;
    /** @type {JoinTrialAnswer|null} */
    this.trial = null;
    this.busy = "";
    this.problem = "";
    /** Where it lies now. @type {Pose|null} */
    this._pose = null;
    this._asked = 0;
  }

  /** Begin; component: the one to be moved, if that is known. @param {string} [component] */
  start(component = "") {
    this._reset(component);
    this.active = true;
    this._onChange();
  }

  /** End; all lie again as they did. */
  stop() {
    if (!this.active) return;
    this._reset("");
    this.active = false;
    this._onChange();
  }

  /** @param {string} component */
  _reset(component) {
    this._asked += 1;
    Object.assign(this, { component, said: null, trial: null, busy: "", problem: "", _pose: null });
  }

  /** Take hold of what lies at a point; whether there is something. @param {{x: number, y: number}} point page [m] */
  grab(point) {
    const { state, placement } = this._app.view;
    const under = (state?.components ?? []).filter(({ id, bounds }) => {
      const pose = placement.get(id);
      if (!pose) return false;
      const { x, y } = apply(inverse(pose), point.x, point.y);
      return x >= bounds.xMin && x <= bounds.xMax && y >= bounds.yMin && y <= bounds.yMax;
    });
    const held = under.find(({ id }) => id === this.component) ?? under[under.length - 1];
    if (!held) return false;
    if (held.id !== this.component) this._reset(held.id);
    this._pose ??= placement.get(held.id) ?? null;
    return this._pose !== null;
  }

  /** @param {number} dx page [m] @param {number} dy */
  move(dx, dy) {
    if (this._pose) this._lay({ ...this._pose, x: this._pose.x + dx, y: this._pose.y + dy });
  }

  /** Turn it about its middle. @param {number} steps of 15 degrees, counter-clockwise */
  turn(steps) {
    const { state, placement } = this._app.view;
    const found = state?.component(this.component);
    const pose = this._pose ?? placement.get(this.component);
    if (!found || !pose) return;
    const { x, y } = found.bounds.centre;
    const middle = apply(pose, x, y);
    const turned = { x: 0, y: 0, theta: pose.theta + steps * QUARTER };
    const off = apply(turned, x, y);
    this._lay({ x: middle.x - off.x, y: middle.y - off.y, theta: turned.theta });
    void this.drop();
  }

  /** @param {Pose} pose */
  _lay(pose) {
    this._pose = pose;
    this.trial = null;
    this._app.view.relay();
  }

  /** Put what is laid elsewhere into its place. @param {Map<string, Pose>} placement */
  place(placement) {
    if (this._pose && placement.has(this.component)) placement.set(this.component, this._pose);
  }

  /** It was let go: ask what that would come to. @param {boolean} [anywhere] let the matcher look without a pose */
  async drop(anywhere = false) {
    this.said = this._nearest(anywhere);
    if (!this.said) return;
    const asked = ++this._asked;
    Object.assign(this, { trial: null, problem: "", busy: "Measuring how they lie" });
    this._onChange();
    try {
      const trial = await this._app.api.post(`${this._path}/what-if`, this.said.body);
      if (asked !== this._asked) return;
      this.trial = trial;
      this._snap(trial);
    } catch (error) {
      if (asked !== this._asked) return;
      this.problem = /** @type {Error} */ (error).message;
    }
    this.busy = "";
    this._onChange();
  }

  /** No longer wait for an answer. */
  cancel() {
    this._asked += 1;
    this.busy = "";
    this._onChange();
  }

  /** @param {JoinTrialAnswer} trial */
  _snap(trial) {
    const target = this._app.view.placement.get(this.said?.component_a ?? "");
    if (target && trial.T_components) this._pose = compose(target, trial.T_components);
    this._app.view.relay();
  }

  /** Believe it. Returns the constraint. */
  async confirm() {
    if (!this.said || !this.trial) return null;
    const body = { ...this.said.body, T_a_b: this.trial.T_a_b };
    Object.assign(this, { busy: "Joining", problem: "" });
    this._onChange();
    try {
      const made = await this._app.api.post(this._path, body);
      this.stop();
      return made;
    } catch (error) {
      Object.assign(this, { busy: "", problem: /** @type {Error} */ (error).message });
      this._onChange();
      return null;
    }
  }

  get _path() {
    return `v1/sites/${encodeURIComponent(this._app.site)}/constraints`;
  }

  /** What is said: the two keyframes, of this and another component, that lie nearest. @param {boolean} anywhere @returns {Said|null} */
  _nearest(anywhere) {
    const { state, placement } = this._app.view;
    if (!state) return null;
    const nodes = [...state.keyframes.values()];
    const mine = some(nodes.filter(({ component }) => component === this.component), placement);
    const others = some(nodes.filter(({ component }) => component !== this.component), placement);
    let [best, found] = [Infinity, /** @type {[Laid, Laid]|null} */ (null)];
    for (const a of others) {
      for (const b of mine) {
        const distance = Math.hypot(a.at.x - b.at.x, a.at.y - b.at.y);
        if (distance < best) [best, found] = [distance, [a, b]];
      }
    }
    if (!found) return null;
    const [a, b] = found;
    const T_a_b = compose(inverse(a.at), b.at);
    const body = {
      robot_a: a.node.robot, session_a: a.node.session, seq_a: a.node.seq,
      robot_b: b.node.robot, session_b: b.node.session, seq_b: b.node.seq,
      ...(anywhere ? {} : { T_a_b }),
    };
    return { component_a: a.node.component, component_b: this.component, body };
  }
}

/** @typedef {{node: Keyframe, at: Pose}} Laid */

/** Some of the keyframes, as they lie on the page. @param {Keyframe[]} nodes @param {Map<string, Pose>} placement @returns {Laid[]} */
function some(nodes, placement) {
  const step = Math.max(1, Math.ceil(nodes.length / MOST_COMPARED));
  return nodes.flatMap((node, i) => {
    const pose = placement.get(node.component);
    return pose && i % step === 0 ? [{ node, at: compose(pose, node) }] : [];
  });
}
