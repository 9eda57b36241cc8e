/** What the keys do, as the help lists it. */
export const KEYS = [
  { keys: ["←", "→", "↑", "↓"], words: "Move the map" },
  { keys: ["+", "−"], words: "Zoom" },
  { keys: ["F"], words: "Show all and follow the map's growth" },
  { keys: ["Enter"], words: "Inspect what lies under the crosshair; while measuring, set a point" },
  { keys: ["M"], words: "Measure a distance" },
  { keys: ["J"], words: "Lay one part of the map on another: the same place" },
  { keys: ["L"], words: "Localise a scan from a file" },
  { keys: ["Space"], words: "Play or pause the growth" },
  { keys: ["Esc"], words: "Close details, end measuring or joining" },
  { keys: ["T"], words: "Light or dark" },
  { keys: ["?"], words: "These keys" },
];

/** @type {Record<string, [number, number]>} */
const ARROWS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/**
 * @typedef {{pan: (dx: number, dy: number) => void, zoom: (factor: number) => void,
 *   fit: () => void, enter: () => void, measure: () => void, join: () => void, localize: () => void,
 *   play: () => void, escape: () => void, theme: () => void, help: () => void}} Actions
 */

/** Listen to the keys. Arrows and Enter count on the map alone. @param {HTMLElement} map @param {Actions} actions */
export function listen(map, actions) {
  map.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 240 : 60;
    const arrow = ARROWS[event.key];
    if (arrow) actions.pan(step * arrow[0], step * arrow[1]);
    else if (event.key === "Enter") actions.enter();
    else if (event.key === " ") actions.play();
    else return;
    event.preventDefault();
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
    const action = actionOf(event.key, actions);
    if (!action || document.querySelector("dialog[open]")) return;
    action();
    event.preventDefault();
  });
}

/** @param {string} key @param {Actions} actions @returns {(() => void)|undefined} */
function actionOf(key, actions) {
  /** @type {Record<string, () => void>} */
  const byKey = {
    "+": () => actions.zoom(1.3),
    "=": () => actions.zoom(1.3),
    "-": () => actions.zoom(1 / 1.3),
    f: actions.fit,
    m: actions.measure,
    j: actions.join,
    l: actions.localize,
    t: actions.theme,
    "?": actions.help,
    Escape: actions.escape,
  };
  return byKey[key] ?? byKey[key.toLowerCase()];
}

/** @param {EventTarget|null} target */
function isTyping(target) {
  if (!(target instanceof HTMLElement)) return false;
  return target.tagName === "SELECT" || target.matches("input:not([type=checkbox]):not([type=range])");
}
