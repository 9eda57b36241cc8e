import { SiteState } from "./site_state.js";

const MOST_STEPS = 100;

/**
 * Return the keyframes at which the growth of a state can be shown: up to MOST_STEPS, ascending.
 * Keyframes are numbered in the order in which the service made them.
 *
 * @param {SiteState} state @returns {number[]}
 */
export function rebuildSteps(state) {
  const ids = [...state.keyframes.keys()].sort((a, b) => a - b);
  const steps = Math.min(MOST_STEPS, ids.length - 1);
  return Array.from({ length: steps }, (_, i) => ids[Math.floor((i * ids.length) / steps)]);
}

/**
 * Return a state without what was not known yet at a keyframe: today's poses and today's
 * components, but only walls, keyframes and constraints up to then. A wall counts from the
 * keyframe whose stamp is its `first_seen`: robots' clocks need not agree, so where several robots
 * saw a wall, the one whose clock shows the earliest time counts.
 *
 * @param {SiteState} state @param {number} keyframe @returns {SiteState}
 */
export function rebuilt(state, keyframe) {
  const { site, map, robots, graph, constraints } = state.answers;
  const nodes = graph.nodes.filter((node) => node.id <= keyframe);
  const firstAt = stampsOf(graph.nodes);
  /** @type {Map<string, any>} */
  const latest = new Map();
  for (const node of nodes) {
    if (node.id >= (latest.get(node.robot)?.id ?? -1)) latest.set(node.robot, node);
  }
  return new SiteState({
    site,
    map: { ...map, lines: map.lines.filter((line) => seenFrom(line, firstAt) <= keyframe) },
    robots: robots
      .filter((robot) => latest.has(robot.robot))
      .map((robot) => atKeyframe(robot, latest.get(robot.robot))),
    graph: {
      graph: {
        ...graph.graph,
        submaps: (graph.graph.submaps ?? []).filter((s) => Math.max(...s.keyframes) <= keyframe),
      },
      nodes,
      edges: graph.edges.filter((edge) => Math.max(edge.source, edge.target) <= keyframe),
    },
    constraints: constraints.filter((c) => Math.max(c.keyframe_a, c.keyframe_b) <= keyframe),
  });
}

/** @param {import("../net/contract.js").GraphNode[]} nodes */
function stampsOf(nodes) {
  /** @type {Map<string, number>} */
  const found = new Map();
  for (const node of nodes) {
    const key = `${node.robot} ${node.stamp}`;
    if (node.id < (found.get(key) ?? Infinity)) found.set(key, node.id);
  }
  return found;
}

/** @param {import("../net/contract.js").LineAnswer} line @param {Map<string, number>} firstAt */
function seenFrom(line, firstAt) {
  const ids = line.robots.map((robot) => firstAt.get(`${robot} ${line.first_seen}`) ?? Infinity);
  const first = Math.min(...ids);
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
