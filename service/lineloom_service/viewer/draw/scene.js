/**
 * What is drawn, and the part of the page that is looked at.
 *
 * @typedef {import("../geometry/pose.js").Pose} Pose
 * @typedef {{state: import("../data/site_state.js").SiteState, placement: Map<string, Pose>,
 *   palette: import("./palette.js").Palette, layers: import("./layers.js").LayerChoice}} Scene
 * @typedef {{x: number, y: number, scale: number, width: number, height: number}} View
 * Middle of the view [m], pixels per metre, size in pixels.
 */
export {};
