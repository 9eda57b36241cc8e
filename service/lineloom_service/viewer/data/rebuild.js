import { SiteState } from "./site_state.js";

const MOST_STEPS = 100;

/**
 * Return how many keyframes there were when the growth of a state can be shown: up to MOST_STEPS,
 * ascending. A graph has its nodes in the order in which the service made them.
 *
 * @param {SiteState} state @returns {number[]}
 */
export function rebuildSteps(state) {
  const all = state.keyframes.size;
  const steps = Math.min(MOST_STEPS, all - 1);
  return Array.from({ length: steps }, (_, i) => Math.floor((i * all) / steps) + 1);
}

/**
 * Return a state as of its first so many keyframes: today's poses and today's
 * components, but only walls, keyframes and constraints up to then. A wall counts from the
 * keyframe whose stamp is its `first_seen`: robots' clocks need not agree, so where several robots
 * saw a wall, the one whose clock shows the earliest time counts.
 *
 * @param {SiteState} state @param {number} known @returns {SiteState}
 */
export function rebuilt(state, known) {
  const { site, map, robots, graph, constraints } = state.answers;
  const nodes = graph.nodes.slice(0, known);
  const ids = new Set(nodes.map((node) => node.id));
  const firstAt = stampsOf(graph.nodes);
  /** @type {Map<string, any>} */
  const latest = new Map(nodes.map((node) => [node.robot, node]));
  return new SiteState({
    site,
    map: { ...map, lines: map.lines.filter((line) => seenFrom(line, firstAt) < known) },
    robots: robots
      .filter((robot) => latest.has(robot.robot))
      .map((robot) => atKeyframe(robot, latest.get(robot.robot))),
    graph: {
      graph: {
        ...graph.graph,
        submaps: (graph.graph.submaps ?? []).filter((s) => s.keyframes.every((id) => ids.has(id))),
      },
      nodes,
      edges: graph.edges.filter((edge) => ids.has(edge.source) && ids.has(edge.target)),
    },
    constraints: constraints.filter((c) => ids.has(c.keyframe_a) && ids.has(c.keyframe_b)),
  });
}

/** Return the place in the order of what was seen at each robot's stamps. @param {import("../net/contract.js").GraphNode[]} nodes */
function stampsOf(nodes) {
  /** @type {Map<string, number>} */
  const found = new Map();
  for (const [i, node] of nodes.entries()) {
    const key = `${node.robot} ${node.stamp}`;
    if (!found.has(key)) found.set(key, i);
  }
  return found;
}

/** @param {import("../net/contract.js").LineAnswer} line @param {Map<string, number>} firstAt */
function seenFrom(line, firstAt) {
  const places = line.robots.map((robot) => firstAt.get(`${robot} ${line.first_seen}`) ?? Infinity);
  const first = Math.min(...places);
  return first === Infinity ? -1 : first; // not to be found: shown from the start
}

/** @param {import("../net/contract.js").RobotAnswer} robot @param {any} node */
function atKeyframe(robot, node) {
  const { x, y, theta, component, stamp, session, seq } = node;
  return {
    ...robot,
    component,
    pose: { x, y, theta, covariance: null },
    latest_stamp: stamp,
    latest_session: session,
    latest_seq: seq,
  };
}
