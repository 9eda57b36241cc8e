import { Bounds } from "../geometry/bounds.js";
import { LineSet } from "./line_set.js";

/**
 * @typedef {import("../net/contract.js").ConstraintAnswer} ConstraintAnswer
 * @typedef {import("../net/contract.js").GraphNode} Keyframe
 * @typedef {{robot: string, component: string, points: Float32Array}} Path
 * A piece of trajectory at keyframe resolution: x, y per point in the component's frame.
 */

/** What is made of a graph, which several versions may share. @type {WeakMap<import("../net/contract.js").GraphAnswer, {keyframes: Map<string, Keyframe>, paths: Path[]}>} */
const MADE_OF = new WeakMap();

/** Everything that the page shows of a site at one version; never changed once made. */
export class SiteState {
  /**
   * @param {{site: import("../net/contract.js").SiteAnswer,
   *   map: import("../net/contract.js").MapAnswer,
   *   robots: import("../net/contract.js").RobotAnswer[],
   *   graph: import("../net/contract.js").GraphAnswer,
   *   constraints: ConstraintAnswer[]}} answers
   * @param {LineSet} [lines] those of the map, where they are there already
   */
  constructor({ site, map, robots, graph, constraints }, lines) {
    this.answers = { site, map, robots, graph, constraints };
    this.site = site;
    this.version = map.version;
    this.settled = map.settled;
    this.receivedAt = Date.now();
    /** Names in the order of their colours: the same as in the service's own pictures. */
    this.robotNames = robotNamesOf(site, robots);
    this.robots = [...robots].sort((a, b) => (a.robot < b.robot ? -1 : 1));
    this.lines = lines ?? LineSet.of(map.lines, this.robotNames);
    const { keyframes, paths } = madeOf(graph);
    this.keyframes = keyframes;
    /** @type {Map<string, ConstraintAnswer>} */
    this.constraints = new Map(constraints.map((c) => [c.id, c]));
    this.places = graph.graph.submaps ?? [];
    this.paths = paths;
    this.components = componentsOf(this);
  }

  /** @param {string} id */
  component(id) {
    return this.components.find((c) => c.id === id);
  }

  /** @param {string} name */
  robot(name) {
    return this.robots.find((r) => r.robot === name);
  }

  /** Return the component that one has become part of. @param {string} id */
  survivorOf(id) {
    let current = id;
    while (this.site.merged_into[current] !== undefined) current = this.site.merged_into[current];
    return current;
  }
}

/** Return all names, sorted. @param {import("../net/contract.js").SiteAnswer} site @param {import("../net/contract.js").RobotAnswer[]} robots */
export function robotNamesOf(site, robots) {
  return [...new Set([...site.robots, ...robots.map((r) => r.robot)])].sort();
}

/**
 * @typedef {{id: string, robots: string[], keyframes: number, bounds: Bounds,
 *   extent: (theta: number) => Bounds}} Component
 * extent: the box around it when it is turned.
 */

/** @param {SiteState} state @returns {Component[]} */
function componentsOf(state) {
  /** @type {Map<string, Component>} */
  const found = new Map();
  for (const node of state.keyframes.values()) {
    let component = found.get(node.component);
    if (!component) {
      component = componentOf(state, node.component);
      found.set(node.component, component);
    }
    component.keyframes += 1;
    if (!component.robots.includes(node.robot)) component.robots.push(node.robot);
    component.bounds.add(node.x, node.y);
  }
  for (const [id, bounds] of state.lines.bounds) {
    const component = found.get(id) ?? componentOf(state, id);
    component.bounds = component.bounds.union(bounds);
    found.set(id, component);
  }
  return [...found.values()].sort((a, b) => b.keyframes - a.keyframes); // of equal ones the older first
}

/** @param {SiteState} state @param {string} id @returns {Component} */
function componentOf(state, id) {
  /** @type {Map<number, Bounds>} */
  const extents = new Map();
  /** @type {Component} */
  const component = {
    id,
    robots: [],
    keyframes: 0,
    bounds: new Bounds(),
    extent: (theta) => {
      if (theta === 0) return component.bounds;
      const extent = extents.get(theta) ?? turnedBounds(state, id, theta);
      extents.set(theta, extent);
      return extent;
    },
  };
  return component;
}

/** @param {SiteState} state @param {string} id @param {number} theta */
function turnedBounds({ keyframes, lines }, id, theta) {
  const bounds = new Bounds();
  const [c, s] = [Math.cos(theta), Math.sin(theta)];
  /** @param {number} x @param {number} y */
  const add = (x, y) => bounds.add(c * x - s * y, s * x + c * y);
  for (const node of keyframes.values()) if (node.component === id) add(node.x, node.y);
  for (const { component, start, end } of lines.groups) {
    if (component !== id) continue;
    for (let i = 4 * start; i < 4 * end; i += 2) add(lines.ends[i], lines.ends[i + 1]);
  }
  return bounds;
}

/** @param {import("../net/contract.js").GraphAnswer} graph */
function madeOf(graph) {
  let made = MADE_OF.get(graph);
  if (!made) {
    made = { keyframes: new Map(graph.nodes.map((node) => [node.id, node])), paths: pathsOf(graph) };
    MADE_OF.set(graph, made);
  }
  return made;
}

/** Return the robots' ways from keyframe to keyframe, cut where a step is not known. @param {import("../net/contract.js").GraphAnswer} graph @returns {Path[]} */
function pathsOf(graph) {
  const steps = new Set();
  for (const edge of graph.edges) {
    if (edge.kind === "sequential") steps.add(`${edge.source} ${edge.target}`);
  }
  /** @type {Map<string, Keyframe[][]>} */
  const pieces = new Map();
  for (const node of graph.nodes) {
    const ofRobot = pieces.get(node.robot) ?? [];
    pieces.set(node.robot, ofRobot);
    const piece = ofRobot[ofRobot.length - 1];
    if (piece && steps.has(`${piece[piece.length - 1].id} ${node.id}`)) piece.push(node);
    else ofRobot.push([node]);
  }
  return [...pieces].flatMap(([robot, ofRobot]) =>
    ofRobot.map((piece) => ({
      robot,
      component: piece[0].component,
      points: Float32Array.from(piece.flatMap((node) => [node.x, node.y])),
    })),
  );
}
