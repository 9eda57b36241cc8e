import { brief } from "./brief.js";

/**
 * Return what happened between two states, in plain words: components that joined or parted,
 * constraints that an operator or the service has withdrawn, robots that lost their way.
 *
 * @param {import("./site_state.js").SiteState} before
 * @param {import("./site_state.js").SiteState} after
 * @returns {string[]}
 */
export function newsBetween(before, after) {
  return [
    ...joined(before, after),
    ...parted(before, after),
    ...lost(before, after),
    ...silent(before, after),
    ...ailing(before, after),
  ];
}

/** @param {import("./site_state.js").SiteState} before @param {import("./site_state.js").SiteState} after */
function joined(before, after) {
  return before.components
    .filter(({ id }) => after.survivorOf(id) !== id && before.survivorOf(id) === id)
    .map(({ id, robots }) => {
      const survivor = after.survivorOf(id);
      return `Component ${brief(id)} (${robots.join(", ")}) joined ${brief(survivor)}`;
    });
}

/** @param {import("./site_state.js").SiteState} before @param {import("./site_state.js").SiteState} after */
function parted(before, after) {
  return after.components
    .filter(({ id }) => before.survivorOf(id) !== id)
    .map(({ id, robots }) => `Component ${brief(id)} (${robots.join(", ")}) parted from ${brief(before.survivorOf(id))}`);
}

/** @param {import("./site_state.js").SiteState} before @param {import("./site_state.js").SiteState} after */
function ailing(before, after) {
  return after.robots
    .filter(({ robot, health }) => health.length > 0 && before.robot(robot)?.health.length === 0)
    .map(({ robot, health }) => `${robot}: ${health[0]}`);
}

/** @param {import("./site_state.js").SiteState} before @param {import("./site_state.js").SiteState} after */
function lost(before, after) {
  return after.robots
    .filter(({ robot, state }) => state === "lost" && before.robot(robot)?.state === "tracking")
    .map(({ robot }) => `${robot} has lost track`);
}

/** @param {import("./site_state.js").SiteState} before @param {import("./site_state.js").SiteState} after */
function silent(before, after) {
  return after.robots
    .filter(({ robot, state }) => state === "silent" && (before.robot(robot)?.state ?? state) !== state)
    .map(({ robot }) => `${robot} sends nothing`);
}
