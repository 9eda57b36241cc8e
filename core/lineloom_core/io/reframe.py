"""The same site seen from other coordinate frames."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.mapping.answers.site_view import (
    KeyframeView,
    MapLine,
    RobotView,
    SiteView,
    TrajectoryView,
)


def in_frames(view: SiteView, frames: Mapping[str, Pose]) -> SiteView:
    """Return the view with some components moved: by component, T_new_map.

    Components that are not named stay where they are. Constraints are relative poses: they stay.
    """
    if not frames:
        return view
    return replace(
        view,
        robots={name: _robot(robot, frames) for name, robot in view.robots.items()},
        trajectories={name: _trajectory(t, frames) for name, t in view.trajectories.items()},
        lines=tuple(_line(line, frames) for line in view.lines),
        keyframes=tuple(_keyframe(keyframe, frames) for keyframe in view.keyframes),
    )


def only(view: SiteView, components: Collection[str]) -> SiteView:
    """Return what the view knows of some components, and of nothing else."""
    keyframes = tuple(k for k in view.keyframes if k.component in components)
    known = {k.id for k in keyframes}
    return replace(
        view,
        robots={n: r for n, r in view.robots.items() if r.component in components},
        components=tuple(c for c in view.components if c.id in components),
        trajectories={n: _rows_in(t, components) for n, t in view.trajectories.items()},
        lines=tuple(w for w in view.lines if w.component in components),
        keyframes=keyframes,
        constraints=tuple(
            c for c in view.constraints if c.keyframe_a in known and c.keyframe_b in known
        ),
    )


def in_layers(view: SiteView, layers: Collection[str]) -> SiteView:
    """Return the view with the lines of some layers alone."""
    return replace(view, lines=tuple(w for w in view.lines if w.layer in layers))


def _rows_in(trajectory: TrajectoryView, components: Collection[str]) -> TrajectoryView:
    rows = [i for i, name in enumerate(trajectory.component) if name in components]
    return TrajectoryView(
        session=tuple(trajectory.session[i] for i in rows),
        seq=trajectory.seq[rows],
        stamp=trajectory.stamp[rows],
        component=tuple(trajectory.component[i] for i in rows),
        poses=trajectory.poses[rows],
    )


def _robot(robot: RobotView, frames: Mapping[str, Pose]) -> RobotView:
    T = frames.get(robot.component or "")
    if T is None or robot.pose is None:
        return robot
    covariance = robot.covariance
    if covariance is not None:
        c, s = np.cos(T.theta), np.sin(T.theta)
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        covariance = R @ covariance @ R.T
    return replace(robot, pose=T @ robot.pose, covariance=covariance)


def _trajectory(trajectory: TrajectoryView, frames: Mapping[str, Pose]) -> TrajectoryView:
    poses = trajectory.poses.copy()
    component = np.array(trajectory.component)
    for name, T in frames.items():
        rows = component == name
        poses[rows] = _moved(poses[rows], T)
    return replace(trajectory, poses=poses)


def _moved(poses: NDArray[np.float64], T: Pose) -> NDArray[np.float64]:
    return np.column_stack([T.transform(poses[:, :2]), wrap_array(poses[:, 2] + T.theta)])


def _line(line: MapLine, frames: Mapping[str, Pose]) -> MapLine:
    T = frames.get(line.component)
    if T is None:
        return line
    (x1, y1), (x2, y2) = T.transform([[line.x1, line.y1], [line.x2, line.y2]]).tolist()
    return replace(line, x1=x1, y1=y1, x2=x2, y2=y2)


def _keyframe(keyframe: KeyframeView, frames: Mapping[str, Pose]) -> KeyframeView:
    T = frames.get(keyframe.component)
    return keyframe if T is None else replace(keyframe, pose=T @ keyframe.pose)
