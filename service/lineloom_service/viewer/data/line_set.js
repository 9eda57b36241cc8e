import { Bounds } from "../geometry/bounds.js";

/** Levels of support that are told apart by width and strength. */
export const SUPPORT_STEPS = 4;
/** Keyframes from which a wall is drawn at full strength. */
const SOLID_FROM = 8;
/** Stands for "seen by several robots" where a robot's number is expected. */
export const SHARED = 255;

/**
 * @typedef {{component: string, robot: number, step: number, start: number, end: number}} LineGroup
 * Lines start to end (exclusive) of one component and one look.
 */

/** The fused lines of one version in typed arrays, grouped by component and look. */
export class LineSet {
  /**
   * @param {import("../net/contract.js").LineAnswer[]} answers
   * @param {string[]} robots the site's robots, in the order of their colours
   */
  constructor(answers, robots) {
    const number = new Map(robots.map((name, i) => [name, i % SHARED]));
    const components = [...new Set(answers.map((line) => line.component))];
    const componentNumber = new Map(components.map((id, i) => [id, i]));
    /** @param {import("../net/contract.js").LineAnswer} line */
    const lookOf = (line) => {
      const robot = line.robots.length === 1 ? number.get(line.robots[0]) ?? SHARED : SHARED;
      return { robot, step: supportStep(line.support) };
    };
    const keys = answers.map((line) => {
      const { robot, step } = lookOf(line);
      // Strong walls, and those that several robots saw, are drawn last and so lie on top.
      return (componentNumber.get(line.component) ?? 0) * 4096 + step * 512 + robot;
    });
    const order = answers.map((_, i) => i).sort((a, b) => keys[a] - keys[b]);

    this.length = answers.length;
    /** Per line x1, y1, x2, y2 in its component's frame [m]. */
    this.ends = new Float32Array(4 * answers.length);
    /** The answers in the same order. */
    this.answers = order.map((i) => answers[i]);
    /** @type {LineGroup[]} */
    this.groups = [];
    /** @type {Map<string, Bounds>} */
    this.bounds = new Map(components.map((id) => [id, new Bounds()]));
    this._index = new Map();
    this._fill(order.map((i) => keys[i]), lookOf);
  }

  /** Return the number of a line, or -1. @param {string} id */
  indexOf(id) {
    if (this._index.size !== this.length) {
      this._index = new Map(this.answers.map((line, i) => [line.id, i]));
    }
    return this._index.get(id) ?? -1;
  }

  /** About how many bytes this takes, answers included. */
  get bytes() {
    return 300 * this.length;
  }

  /** @param {number[]} keys @param {(line: any) => {robot: number, step: number}} lookOf */
  _fill(keys, lookOf) {
    this.answers.forEach((line, i) => {
      this.ends.set([line.x1, line.y1, line.x2, line.y2], 4 * i);
      const bounds = /** @type {Bounds} */ (this.bounds.get(line.component));
      bounds.add(line.x1, line.y1);
      bounds.add(line.x2, line.y2);
      if (i === 0 || keys[i] !== keys[i - 1]) {
        this.groups.push({ component: line.component, ...lookOf(line), start: i, end: i });
      }
      this.groups[this.groups.length - 1].end = i + 1;
    });
  }
}

/** Return 0 for a wall seen once to SUPPORT_STEPS - 1 for a certain one. @param {number} support */
export function supportStep(support) {
  const share = Math.min(support, SOLID_FROM) / SOLID_FROM;
  return Math.min(SUPPORT_STEPS - 1, Math.floor(share * SUPPORT_STEPS));
}
