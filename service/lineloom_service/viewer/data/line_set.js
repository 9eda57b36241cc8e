import { Bounds } from "../geometry/bounds.js";

/** Levels of support that are told apart by width and strength. */
export const SUPPORT_STEPS = 4;
/** Keyframes from which a wall is drawn at full strength. */
const SOLID_FROM = 8;
/** Stands for "seen by several robots" where a robot's number is expected. */
export const SHARED = 255;
/** About what a line takes in memory: as an answer, and in the arrays [bytes]. */
const [ANSWER_BYTES, ROW_BYTES] = [300, 32];

let made = 0;

/**
 * @typedef {import("../net/contract.js").LineAnswer} LineAnswer
 * @typedef {{component: string, robot: number, step: number, start: number, end: number}} LineGroup
 * Lines start to end (exclusive) of one component and one look.
 */

/**
 * The fused lines of one version in typed arrays, grouped by component and look; never changed once
 * made. The next version is made from it by what has changed: sorting a large map anew would cost longer
 * than a frame.
 */
export class LineSet {
  /** @param {Rows} rows @param {Look} look @param {LineSet} [before] @param {LineAnswer[]} [arrived] */
  constructor({ answers, ends, keys }, look, before, arrived) {
    this.length = answers.length;
    this.answers = answers;
    /** Per line x1, y1, x2, y2 in its component's frame [m]. */
    this.ends = ends;
    this._keys = keys;
    this._look = look;
    /** The lines that its predecessor has not, null where there is none. */
    this.arrived = arrived ?? null;
    this.predecessor = before?.serial ?? 0;
    this.serial = ++made;
    /** About how many bytes this takes beside its predecessor. */
    this.bytes = ROW_BYTES * this.length + ANSWER_BYTES * (arrived ?? answers).length;
    this.groups = groupsOf(answers, keys, look);
    this.bounds = boundsOf(this.groups, ends);
    /** Where lines that were asked for are. @type {Map<string, number>} */
    this._index = new Map();
  }

  /**
   * Return the set of all lines of a map.
   *
   * @param {LineAnswer[]} answers @param {string[]} robots the site's, in the order of their colours
   */
  static of(answers, robots) {
    const look = new Look(robots);
    return new LineSet(sorted(answers, look), look);
  }

  /**
   * Return the set after some lines have come, changed or gone.
   *
   * @param {import("./table_change.js").TableChange<LineAnswer>} change
   * @param {Map<string, LineAnswer>} out those of this set that do not stay as they are, by id
   * @param {string[]} robots
   */
  updated(change, out, robots) {
    const leaving = new Set(out.values());
    if (!this._look.knows(robots)) {
      const staying = this.answers.filter((line) => !leaving.has(line));
      return LineSet.of([...staying, ...change.entries], robots);
    }
    const rows = new Rows(this.length + change.entries.length);
    rows.merge(this, sorted(change.entries, this._look), leaving);
    return new LineSet(rows.done(), this._look, this, change.cameTo(out));
  }

  /** Return the number of a line, or -1. @param {string} id */
  indexOf(id) {
    const known = this._index.get(id);
    if (known !== undefined) return known;
    const found = this.answers.findIndex((line) => line.id === id);
    this._index.set(id, found);
    return found;
  }
}

/** Lines with what is drawn of them, in the order of drawing. */
class Rows {
  /** @param {number} most room for so many */
  constructor(most) {
    /** @type {LineAnswer[]} */
    this.answers = new Array(most);
    this.ends = new Float32Array(4 * most);
    this.keys = new Int32Array(most);
    this._length = 0;
  }

  /** @param {LineAnswer} line @param {number} key */
  add(line, key) {
    const at = this._length++;
    this.answers[at] = line;
    this.keys[at] = key;
    this.ends[4 * at] = line.x1;
    this.ends[4 * at + 1] = line.y1;
    this.ends[4 * at + 2] = line.x2;
    this.ends[4 * at + 3] = line.y2;
  }

  /**
   * Take what stays of a set, and what comes. Lines are told apart as objects: to look a hundred
   * thousand names up takes longer than all else together.
   *
   * @param {LineSet} before @param {Rows} coming @param {Set<LineAnswer>} leaving
   */
  merge(before, coming, leaving) {
    let [from, next] = [0, 0];
    for (let i = 0; i < before.length; i++) {
      if (next < coming._length && coming.keys[next] < before._keys[i]) {
        this._copy(before, from, i);
        from = i;
        while (next < coming._length && coming.keys[next] < before._keys[i]) this._from(coming, next++);
      }
      if (leaving.has(before.answers[i])) {
        this._copy(before, from, i);
        from = i + 1;
      }
    }
    this._copy(before, from, before.length);
    while (next < coming._length) this._from(coming, next++);
  }

  /** Return these rows, without room for more. */
  done() {
    this.answers.length = this._length;
    this.ends = this.ends.subarray(0, 4 * this._length);
    this.keys = this.keys.subarray(0, this._length);
    return this;
  }

  /** @param {Rows} rows @param {number} i */
  _from(rows, i) {
    this.add(rows.answers[i], rows.keys[i]);
  }

  /** Take rows start to end (exclusive) as they are: much faster than one by one. @param {LineSet} set @param {number} start @param {number} end */
  _copy(set, start, end) {
    const at = this._length;
    this.ends.set(set.ends.subarray(4 * start, 4 * end), 4 * at);
    this.keys.set(set._keys.subarray(start, end), at);
    for (let i = start; i < end; i++) this.answers[at + i - start] = set.answers[i];
    this._length = at + end - start;
  }
}

/** @param {LineAnswer[]} answers @param {Look} look */
function sorted(answers, look) {
  const keys = answers.map((line) => look.keyOf(line));
  const rows = new Rows(answers.length);
  for (const i of answers.map((_, i) => i).sort((a, b) => keys[a] - keys[b])) rows.add(answers[i], keys[i]);
  return rows;
}

/** Where the lines of a look come in the order of drawing. */
class Look {
  /** @param {string[]} robots */
  constructor(robots) {
    this._names = robots.join("\n");
    this._robots = new Map(robots.map((name, i) => [name, i % SHARED]));
    /** Components' numbers, given as they come. @type {Map<string, number>} */
    this._components = new Map();
  }

  /** Tell whether robots still have the numbers that they had. @param {string[]} robots */
  knows(robots) {
    return robots.join("\n") === this._names;
  }

  /** Strong walls, and those that several robots saw, are drawn last and so lie on top. @param {LineAnswer} line */
  keyOf(line) {
    let component = this._components.get(line.component);
    if (component === undefined) {
      component = this._components.size;
      this._components.set(line.component, component);
    }
    return component * 4096 + supportStep(line.support) * 512 + this.robotOf(line);
  }

  /** @param {LineAnswer} line */
  robotOf(line) {
    return line.robots.length === 1 ? this._robots.get(line.robots[0]) ?? SHARED : SHARED;
  }
}

/** @param {LineAnswer[]} answers @param {Int32Array} keys @param {Look} look @returns {LineGroup[]} */
function groupsOf(answers, keys, look) {
  const groups = [];
  for (let start = 0, end = 0; start < answers.length; start = end) {
    while (end < answers.length && keys[end] === keys[start]) end++;
    const line = answers[start];
    groups.push({
      component: line.component,
      robot: look.robotOf(line),
      step: supportStep(line.support),
      start,
      end,
    });
  }
  return groups;
}

/** Return what each component takes up. @param {LineGroup[]} groups @param {Float32Array} ends */
function boundsOf(groups, ends) {
  /** @type {Map<string, Bounds>} */
  const found = new Map();
  for (const { component, start, end } of groups) {
    const bounds = found.get(component) ?? new Bounds();
    for (let i = 2 * start; i < 2 * end; i++) bounds.add(ends[2 * i], ends[2 * i + 1]);
    found.set(component, bounds);
  }
  return found;
}

/** Return 0 for a wall seen once to SUPPORT_STEPS - 1 for a certain one. @param {number} support */
export function supportStep(support) {
  const share = Math.min(support, SOLID_FROM) / SOLID_FROM;
  return Math.min(SUPPORT_STEPS - 1, Math.floor(share * SUPPORT_STEPS));
}
