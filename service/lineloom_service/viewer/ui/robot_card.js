import { h } from "./dom.js";
import { card, facts, part, tag } from "./card.js";
import { count, degrees, metres, stamp } from "./format.js";
import { positionEllipse } from "../geometry/ellipse.js";
import { brief } from "../data/brief.js";

/**
 * How a robot is doing.
 *
 * @param {import("../net/contract.js").RobotAnswer} robot
 * @param {import("./inspector.js").CardContext} context
 */
export function robotCard(robot, { onClose, onPick, onGoTo, onDownload }) {
  const { pose, scans, component } = robot;
  const ellipse = positionEllipse(pose?.covariance);
  const turn = pose?.covariance?.[2][2];
  return card(
    robot.robot,
    tag(robot.state),
    onClose,
    robot.health.length > 0 &&
      part("Health", h("ul", { className: "health" }, ...robot.health.map((finding) => h("li", {}, finding)))),
    part(
      "Pose",
      pose
        ? facts([
            ["Component", component && brief(component)],
            ["Position", `${pose.x.toFixed(2)}, ${pose.y.toFixed(2)} m`],
            ["Heading", degrees(pose.theta)],
            ["Within (95 %)", ellipse ? `${metres(ellipse.major)} × ${metres(ellipse.minor)}` : "not known"],
            ["Heading within", turn === null || turn === undefined ? "not known" : `± ${degrees(1.96 * Math.sqrt(turn))}`],
          ])
        : h("p", { className: "muted" }, "No scan of it has been placed yet."),
    ),
    part(
      "Scans",
      facts([
        ["Accepted", count(scans.accepted)],
        ["In the map", count(scans.processed)],
        ["Waiting", scans.pending ? count(scans.pending) : null],
        ["Left out", scans.skipped ? count(scans.skipped) : null],
        ["Keyframes", count(robot.keyframes)],
        ["Latest", robot.latest_stamp === null ? null : stamp(robot.latest_stamp)],
        ["Session, seq", robot.latest_seq === null ? null : `${robot.latest_session}, ${robot.latest_seq}`],
      ]),
    ),
    h(
      "div",
      { className: "buttons" },
      h("button", { onclick: () => onGoTo({ kind: "robot", id: robot.robot }), "data-key": "go" }, "Show"),
      component !== null &&
        h("button", { onclick: () => onPick({ kind: "component", id: component }), "data-key": "component" }, `Component ${brief(component)}`),
      h(
        "button",
        { onclick: () => onDownload(`robots/${robot.robot}/trajectory?format=tum`, `${robot.robot}.tum`), "data-key": "tum" },
        "Trajectory (TUM)",
      ),
    ),
  );
}
