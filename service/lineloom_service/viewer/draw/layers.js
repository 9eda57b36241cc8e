/**
 * What is shown. Constraints are chosen by their state.
 *
 * @typedef {{lines: boolean, trajectories: boolean, robots: boolean, ellipses: boolean,
 *   keyframes: boolean, places: boolean, accepted: boolean, candidate: boolean,
 *   rejected: boolean, retracted: boolean, grid: boolean}} LayerChoice
 */

/** @type {Readonly<LayerChoice>} */
export const DEFAULT_LAYERS = Object.freeze({
  lines: true,
  trajectories: true,
  robots: true,
  ellipses: true,
  keyframes: false,
  places: false,
  accepted: false,
  candidate: true,
  rejected: false,
  retracted: true,
  grid: true,
});

/** Names for people, in the order of the list. @type {[keyof LayerChoice, string][]} */
export const LAYER_NAMES = [
  ["lines", "Walls"],
  ["trajectories", "Trajectories"],
  ["robots", "Robots"],
  ["ellipses", "Uncertainty (95 %)"],
  ["keyframes", "Keyframes"],
  ["places", "Places"],
  ["grid", "Grid"],
];

/** @type {[keyof LayerChoice, string][]} */
export const CONSTRAINT_NAMES = [
  ["accepted", "Accepted"],
  ["candidate", "Candidate"],
  ["rejected", "Rejected"],
  ["retracted", "Retracted"],
];
