import { SHARED, SUPPORT_STEPS } from "../data/line_set.js";

/** Robots' colours, after Okabe and Ito 2008: told apart with any kind of colour vision. */
const ROBOTS = {
  light: ["#0072b2", "#d55e00", "#009e73", "#a64d86", "#b8860b", "#3a9bd0"],
  dark: ["#56b4e9", "#ff8c42", "#2fd0a0", "#e08ac4", "#e6c02e", "#8fb8ff"],
};

const INKS = {
  light: {
    paper: "#fbfcfd",
    grid: "#eceff3",
    gridStrong: "#dde3e9",
    ink: "#1f2933",
    muted: "#5a6773",
    frame: "#c9d1d9",
    accent: "#0b62c4",
    accepted: "#0d7a4f",
    candidate: "#b26a00",
    rejected: "#c0362c",
    retracted: "#7a8691",
  },
  dark: {
    paper: "#0c1115",
    grid: "#141b21",
    gridStrong: "#1d262e",
    ink: "#dfe6ec",
    muted: "#9aa7b3",
    frame: "#33404b",
    accent: "#6cb2ff",
    accepted: "#4ccb94",
    candidate: "#f0b45a",
    rejected: "#ff8a80",
    retracted: "#8793a0",
  },
};

/** The colours of one theme. */
export class Palette {
  /** @param {"light"|"dark"} theme */
  constructor(theme) {
    this.theme = theme;
    this.ink = INKS[theme];
  }

  /** Return the colour of a site's index-th robot, or of what several saw. @param {number} index */
  robot(index) {
    if (index === SHARED) return this.ink.ink;
    const fixed = ROBOTS[this.theme];
    if (index < fixed.length) return fixed[index];
    // The golden ratio spreads any number of hues.
    const hue = Math.round(360 * ((index * 0.618033988749895) % 1));
    return `hsl(${hue} 65% ${this.theme === "light" ? 36 : 66}%)`;
  }

  /** Width [px] and strength of a wall by its support. @param {number} step */
  wall(step) {
    const share = (step + 1) / SUPPORT_STEPS;
    return { width: 1 + 1.4 * share, alpha: 0.4 + 0.6 * share };
  }

  /** @param {string} state of a constraint */
  constraint(state) {
    return /** @type {Record<string, string>} */ (this.ink)[state] ?? this.ink.muted;
  }
}
