"""Which part of a site an export is about."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.mapping.answers.site_view import (
    ComponentView,
    MapLine,
    RobotView,
    SiteView,
    TrajectoryView,
)

BBox = tuple[float, float, float, float]
"""x_min, y_min, x_max, y_max [m] in the component's map frame."""


MOST_COORDINATE_M = 1e6
"""Of a bbox: no map is that large, and pages and grids are laid out by it."""


class UnknownComponentError(KeyError):
    """The site has no such component (any more). The text says what it has."""

    def __str__(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True)
class Path:
    """An unbroken piece of a robot's trajectory: poses (n, 3) x, y, theta in the map frame."""

    robot: str
    session: str
    poses: NDArray[np.float64]


@dataclass(frozen=True)
class ComponentContent:
    """What there is to show of one component. robots: those whose latest pose lies in it."""

    component: ComponentView
    lines: tuple[MapLine, ...]
    paths: tuple[Path, ...]
    robots: tuple[RobotView, ...]


def select(
    view: SiteView, component: str | None = None, bbox: BBox | None = None
) -> tuple[ComponentContent, ...]:
    """Return the content of the component asked for, or of all, in the view's order.

    With a bbox only what touches it: whole lines, the stretches of paths inside, robots inside.
    Raises UnknownComponentError (a KeyError) and, for a bbox that encloses nothing, ValueError.
    """
    check_bbox(bbox)
    chosen = [c for c in view.components if component is None or c.id == component]
    if component is not None and not chosen:
        if component in view.merged_into:
            raise UnknownComponentError(
                f"component {component!r} was merged into {view.merged_into[component]!r}"
            )
        known = ", ".join(repr(c.id) for c in view.components) or "none"
        raise UnknownComponentError(f"no component {component!r} here; there is: {known}")
    lines: dict[str, list[MapLine]] = {}
    for line in view.lines:
        if bbox is None or clip((line.x1, line.y1, line.x2, line.y2), bbox) is not None:
            lines.setdefault(line.component, []).append(line)
    paths: dict[str, list[Path]] = {}
    for robot in sorted(view.trajectories):
        for where, path in _paths(robot, view.trajectories[robot], bbox):
            paths.setdefault(where, []).append(path)
    return tuple(
        ComponentContent(
            component=c,
            lines=tuple(lines.get(c.id, ())),
            paths=tuple(paths.get(c.id, ())),
            robots=tuple(_robots_in(view, c.id, bbox)),
        )
        for c in chosen
    )


def check_bbox(bbox: BBox | None) -> None:
    """Raise ValueError for a bbox that is not finite, out of this world, or encloses nothing."""
    if bbox is None:
        return
    if len(bbox) != 4 or not all(math.isfinite(v) for v in bbox):
        raise ValueError("bbox must be four finite numbers: x_min, y_min, x_max, y_max")
    if max(abs(v) for v in bbox) > MOST_COORDINATE_M:
        raise ValueError(f"bbox must lie within {MOST_COORDINATE_M / 1000:g} km of the origin")
    if bbox[0] >= bbox[2] or bbox[1] >= bbox[3]:
        raise ValueError("bbox must have x_min < x_max and y_min < y_max")


def clip(segment: BBox, bbox: BBox) -> BBox | None:
    """Return the part of a segment x1, y1, x2, y2 inside the box, None where there is none.

    Liang and Barsky 1984.
    """
    x1, y1, x2, y2 = segment
    dx, dy = x2 - x1, y2 - y1
    first, last = 0.0, 1.0
    for p, q in ((-dx, x1 - bbox[0]), (dx, bbox[2] - x1), (-dy, y1 - bbox[1]), (dy, bbox[3] - y1)):
        if p == 0.0:
            if q < 0.0:
                return None
        elif p < 0.0:
            first = max(first, q / p)
        else:
            last = min(last, q / p)
    if first > last:
        return None
    return (x1 + first * dx, y1 + first * dy, x1 + last * dx, y1 + last * dy)


def _paths(robot: str, trajectory: TrajectoryView, bbox: BBox | None) -> Iterator[tuple[str, Path]]:
    """Yield (component, path), split where component or session change or the bbox is left."""
    poses = trajectory.poses
    inside = np.ones(poses.shape[0], dtype=np.bool_)
    if bbox is not None:
        x, y = poses[:, 0], poses[:, 1]
        inside = (x >= bbox[0]) & (x <= bbox[2]) & (y >= bbox[1]) & (y <= bbox[3])
    start = 0
    for end in range(1, poses.shape[0] + 1):
        if end < poses.shape[0] and (
            trajectory.component[end] == trajectory.component[start]
            and trajectory.session[end] == trajectory.session[start]
            and inside[end] == inside[start]
        ):
            continue
        if inside[start]:
            piece = Path(robot, trajectory.session[start], poses[start:end])
            yield trajectory.component[start], piece
        start = end


def _robots_in(view: SiteView, component: str, bbox: BBox | None) -> Iterator[RobotView]:
    for name in sorted(view.robots):
        robot = view.robots[name]
        if robot.component != component or robot.pose is None:
            continue
        x, y = robot.pose.x, robot.pose.y
        if bbox is None or (bbox[0] <= x <= bbox[2] and bbox[1] <= y <= bbox[3]):
            yield robot
