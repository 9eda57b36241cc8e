"""Where one robot is, seen from another: from their poses in a common map frame."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import networkx as nx
import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import RobotView, SiteView
from numpy.typing import NDArray


class NotConnectedError(Exception):
    """The robots' poses are not known in one frame; the text says why."""


@dataclass(frozen=True, slots=True)
class RelativePose:
    """T_a_b at both robots' latest scans.

    covariance: 3x3 over x, y, theta in a's frame. constraints: the fewest accepted ones, other
    than sequential, that tie the two trajectories together.
    """

    component: str
    T_a_b: Pose
    covariance: NDArray[np.float64] | None
    constraints: tuple[str, ...]


def relative_pose(view: SiteView, robot_a: str, robot_b: str) -> RelativePose:
    """Return T_a_b, or raise NotConnectedError."""
    a, b = _placed(view, robot_a), _placed(view, robot_b)
    assert a.pose is not None
    assert b.pose is not None
    if a.component is None or a.component != b.component:
        raise NotConnectedError(
            f"{robot_a} is in component {a.component}, {robot_b} in component {b.component}"
        )
    T_a_b = a.pose.between(b.pose)
    return RelativePose(
        component=a.component,
        T_a_b=T_a_b,
        covariance=_covariance(a, b, T_a_b),
        constraints=_ties(view, robot_a, robot_b),
    )


def _placed(view: SiteView, robot: str) -> RobotView:
    found = view.robots.get(robot)
    if found is None or found.pose is None:
        raise NotConnectedError(f"{robot} has no pose yet")
    return found


def _covariance(a: RobotView, b: RobotView, T_a_b: Pose) -> NDArray[np.float64] | None:
    """First order, with the two robots' errors taken as independent.

    They share a map, so their errors go together and the true figure is smaller or equal for
    robots near each other: this one errs on the safe side.
    """
    if a.robot == b.robot:
        return np.zeros((3, 3))
    if a.covariance is None or b.covariance is None or a.pose is None:
        return None
    c, s = np.cos(a.pose.theta), np.sin(a.pose.theta)
    J_b = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    J_a = -J_b
    J_a[:2, 2] = T_a_b.y, -T_a_b.x
    covariance: NDArray[np.float64] = J_a @ a.covariance @ J_a.T + J_b @ b.covariance @ J_b.T
    return covariance


def _ties(view: SiteView, robot_a: str, robot_b: str) -> tuple[str, ...]:
    """Find the path between the latest keyframes that takes the fewest non-sequential edges."""
    latest = {keyframe.robot: keyframe.id for keyframe in view.keyframes}
    graph = nx.Graph()
    for constraint in view.constraints:
        if constraint.state == "accepted":
            tie = None if constraint.kind == "sequential" else constraint.id
            ends = constraint.keyframe_a, constraint.keyframe_b
            # A step is free, and of several constraints between two keyframes the first stands.
            if tie is None or not graph.has_edge(*ends):
                graph.add_edge(*ends, tie=tie, weight=int(tie is not None))
    try:
        path = nx.bidirectional_dijkstra(graph, latest[robot_a], latest[robot_b])[1]
    except (KeyError, nx.NodeNotFound, nx.NetworkXNoPath):
        return ()
    ties = (graph.edges[step]["tie"] for step in pairwise(path))
    return tuple(tie for tie in ties if tie is not None)
