"""Judging a fleet's map by the truth: which robots are joined, and whether rightly.

Two pieces of tracking are joined rightly where the graph puts the two keyframes of a constraint
between them to within 1 m and 15 degrees of the truth, on one floor. Right joins carry over: if 1
is rightly joined with 2 and 2 with 3, so is 1 with 3. Robots of one component without such a chain
are joined falsely, however they came to be there: one false merge of two large components makes
many false pairs, as it spoils many maps.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import networkx as nx
import numpy as np
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.mapping.answers.site_view import ConstraintView, KeyframeView, SiteView
from numpy.typing import NDArray

from lineloom_lab.evaluation.merge_bench_fleets import BenchFleet
from lineloom_lab.evaluation.trajectory import align_rigid
from lineloom_lab.simulation import SimulatedScan

MOST_OFF_M = 1.0
MOST_TURNED_RAD = np.radians(15.0)

RobotPair = tuple[str, str]
"""Names in ascending order."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Robot pairs in one component: joined rightly, and falsely."""

    right: frozenset[RobotPair]
    false: frozenset[RobotPair]


@dataclass(frozen=True, slots=True)
class PoseFigures:
    """Scans in components of several robots, and how many of them are off by more than 1 m."""

    placed: int
    off: int


class Judge:
    """Knows a fleet's true poses; fed with every scan before it is asked."""

    def __init__(self, fleet: BenchFleet) -> None:
        self._floor = {robot.name: robot.floor for robot in fleet.robots}
        self._undeclared = {robot.name for robot in fleet.robots if robot.undeclared}
        self._truth: dict[tuple[str, int], Pose] = {}

    def note(self, scan: SimulatedScan) -> None:
        """Remember where a scan was truly taken."""
        self._truth[scan.robot, scan.scan.seq] = scan.true_pose

    def verdict(self, view: SiteView) -> Verdict:
        """Which robots are joined in a view, rightly or falsely."""
        tracks = _tracks(view)
        mirrored = {t for t, frames in tracks.items() if self._is_mirrored(frames)}
        rightly = nx.Graph()
        rightly.add_nodes_from(tracks)
        for a, b, track_a, track_b in _joints(view, tracks):
            if self._is_right(a, b, mirrored & {track_a, track_b}):
                rightly.add_edge(track_a, track_b)
        group = {t: g for g, members in enumerate(nx.connected_components(rightly))
                 for t in members}  # fmt: skip
        right: set[RobotPair] = set()
        false: set[RobotPair] = set()
        for ta, tb in combinations(sorted(tracks), 2):
            a, b = tracks[ta][0], tracks[tb][0]
            if a.robot == b.robot or a.component != b.component:
                continue
            pair = (min(a.robot, b.robot), max(a.robot, b.robot))
            (right if group[ta] == group[tb] else false).add(pair)
        return Verdict(frozenset(right), frozenset(false))

    def is_true(self, view: SiteView, constraint: ConstraintView) -> bool:
        """Whether a constraint, believed or not, says what is true."""
        frames = {k.id: k for k in view.keyframes if k.id in _ends(constraint)}
        a, b = frames[constraint.keyframe_a], frames[constraint.keyframe_b]
        if self._undeclared & {a.robot, b.robot}:
            return False
        return self._fits(a, b, constraint.T_a_b)

    def poses(self, view: SiteView, verdict: Verdict) -> PoseFigures:
        """Count scans off by more than 1 m after the largest rightly joined part is aligned."""
        placed = off = 0
        for component in view.components:
            if len(component.robots) < 2:
                continue
            rows = {r: self._rows(view, r, component.id) for r in component.robots}
            trusted = _largest_right_group(component.robots, verdict.right, rows)
            estimate = np.concatenate([rows[r][0] for r in trusted])
            truth = np.concatenate([rows[r][1] for r in trusted])
            T = align_rigid(estimate, truth)
            home = self._floor[trusted[0]]
            for robot, (found, true) in rows.items():
                apart = np.linalg.norm(T.transform(found[:, :2]) - true[:, :2], axis=1)
                wrong = apart > MOST_OFF_M if self._floor[robot] == home else apart >= 0.0
                placed += len(found)
                off += int(np.count_nonzero(wrong))
        return PoseFigures(placed, off)

    def _rows(
        self, view: SiteView, robot: str, component: str
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A robot's placed scans in a component: found and true poses, (n, 3) each."""
        trajectory = view.trajectories[robot]
        here = np.array([c == component for c in trajectory.component], dtype=bool)
        base = trajectory.poses[here]
        true = [self._truth[robot, int(seq)].to_array() for seq in trajectory.seq[here]]
        return base, np.array(true).reshape(-1, 3)

    def _is_right(self, a: KeyframeView, b: KeyframeView, mirrored: set[int]) -> bool:
        return not mirrored and self._fits(a, b, a.pose.between(b.pose))

    def _fits(self, a: KeyframeView, b: KeyframeView, T_a_b: Pose) -> bool:
        if self._floor[a.robot] != self._floor[b.robot]:
            return False
        true = self._truth[a.robot, a.seq].between(self._truth[b.robot, b.seq])
        turned = abs(angle_difference(true.theta, T_a_b.theta))
        return true.distance(T_a_b) <= MOST_OFF_M and bool(turned <= MOST_TURNED_RAD)

    def _is_mirrored(self, frames: list[KeyframeView]) -> bool:
        """Whether a piece of tracking is a mirror image of the truth."""
        if frames[0].robot not in self._undeclared:
            return False
        if len(frames) < 3:
            return True
        found = np.array([k.pose.to_array() for k in frames])
        true = np.array([self._truth[k.robot, k.seq].to_array() for k in frames])
        return _misfit(found * [1.0, -1.0, -1.0], true) < _misfit(found, true)


def _misfit(found: NDArray[np.float64], true: NDArray[np.float64]) -> float:
    """How badly steps between successive poses agree: turns above all."""
    steps = wrap_array(np.diff(found[:, 2])) - wrap_array(np.diff(true[:, 2]))
    return float(np.sum(wrap_array(steps) ** 2))


def _ends(constraint: ConstraintView) -> tuple[str, str]:
    return constraint.keyframe_a, constraint.keyframe_b


def _tracks(view: SiteView) -> dict[int, list[KeyframeView]]:
    """Pieces of tracking, numbered by their first keyframe: what steps hold together."""
    chain = nx.Graph()
    number = {k.id: i for i, k in enumerate(view.keyframes)}
    chain.add_nodes_from(number.values())
    steps = (c for c in view.constraints if c.kind == "sequential" and c.state == "accepted")
    chain.add_edges_from((number[c.keyframe_a], number[c.keyframe_b]) for c in steps)
    pieces = (sorted(piece) for piece in nx.connected_components(chain))
    return {piece[0]: [view.keyframes[i] for i in piece] for piece in pieces}


def _joints(
    view: SiteView, tracks: dict[int, list[KeyframeView]]
) -> Iterable[tuple[KeyframeView, KeyframeView, int, int]]:
    """Both keyframes, with their tracks, of every accepted constraint between two tracks."""
    track_of = {k.id: (t, k) for t, frames in tracks.items() for k in frames}
    for c in view.constraints:
        if c.state == "accepted" and c.kind != "sequential":
            (ta, a), (tb, b) = track_of[c.keyframe_a], track_of[c.keyframe_b]
            if ta != tb:
                yield a, b, ta, tb


def _largest_right_group(
    robots: tuple[str, ...],
    right: frozenset[RobotPair],
    rows: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> list[str]:
    graph = nx.Graph()
    graph.add_nodes_from(robots)
    graph.add_edges_from(pair for pair in right if set(pair) <= set(robots))
    groups = [sorted(members) for members in nx.connected_components(graph)]
    return max(groups, key=lambda g: (sum(len(rows[r][0]) for r in g), g))
