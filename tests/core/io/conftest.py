"""A site view that looks like a real one: two robots in one office floor, a third on its own."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import (
    ComponentView,
    ConstraintView,
    KeyframeView,
    MapLine,
    RobotView,
    SiteView,
    TrajectoryView,
)
from lineloom_core.mapping.belief.constraint_state import ConstraintState
from lineloom_core.mapping.facts.scan_name import ScanName
from numpy.typing import NDArray

Wall = tuple[float, float, float, float]


def floor_walls() -> list[Wall]:
    """A corridor of 30 m with rooms on both sides; the free side of each wall on its left."""
    walls: list[Wall] = [(0.0, 1.2, 0.0, -1.2), (30.0, -1.2, 30.0, 1.2)]
    for k in range(6):
        x, w, depth = 5.0 * k, 4.9, 4.5 + 0.5 * (k % 3)
        door = x + 1.2 + 0.4 * (k % 4)
        for side in (1.0, -1.0):
            y, far = 1.2 * side, (1.3 + depth) * side
            room = [
                (x + 5.0, y, door + 1.0, y),
                (door, y, x, y),
                (x, 1.3 * side, door, 1.3 * side),
                (door + 1.0, 1.3 * side, x + w, 1.3 * side),
                (x + w, 1.3 * side, x + w, far),
                (x + w, far, x, far),
                (x, far, x, 1.3 * side),
                (x + 2.0, far - 0.8 * side, x + 3.4, far - 0.8 * side),
            ]
            walls += room if side > 0 else [(c, d, a, b) for a, b, c, d in room]
    return walls


def lines_of(component: str, walls: list[Wall], robots: list[str], seed: int) -> list[MapLine]:
    rng = np.random.default_rng(seed)
    lines = []
    for i, wall in enumerate(walls):
        x1, y1, x2, y2 = (np.array(wall) + rng.normal(0.0, 0.01, 4)).tolist()
        support = int(rng.integers(1, 20))
        seen = robots if i % 3 == 0 else [robots[i % len(robots)]]
        lines.append(
            MapLine(
                f"{component}-{i}",
                component,
                x1,
                y1,
                x2,
                y2,
                0.01,
                support,
                tuple(seen),
                1.5,
                99.25,
            )
        )
    return lines


def drive(component: str, poses: NDArray[np.float64]) -> TrajectoryView:
    n = poses.shape[0]
    return TrajectoryView(
        ("0",) * n,
        np.arange(n),
        1e9 + 0.1 * np.arange(n, dtype=np.float64),
        (component,) * n,
        poses,
    )


def corridor_drive(start: float, end: float, room: float) -> NDArray[np.float64]:
    """Along the corridor, with a visit to one room on the way."""
    x = np.linspace(start, end, 200)
    y = 0.3 * np.sin(x / 2.0) + 3.4 * np.exp(-(((x - room) / 0.35) ** 2))
    theta = np.arctan2(np.gradient(y), np.gradient(x))
    return np.column_stack([x, y, theta])


@pytest.fixture(scope="session")
def site_view() -> SiteView:
    trajectories = {
        "alice": drive("c1", corridor_drive(1.0, 22.0, 11.9)),
        "bob": drive("c1", corridor_drive(29.0, 9.0, 17.3)),
        "carol": drive("c3", corridor_drive(1.0, 8.0, 6.6)),
    }
    names = {"alice": "c1", "bob": "c1", "carol": "c3"}
    robots = {
        name: RobotView(
            robot=name,
            component=component,
            pose=Pose.from_array(trajectories[name].poses[-1]),
            covariance=np.eye(3) * 1e-4,
            state="tracking",
            scans_processed=200,
            keyframes=3,
            latest_stamp=1e9 + 20.0,
            latest_session="0",
            latest_seq=199,
        )
        for name, component in names.items()
    }
    small = [w for w in floor_walls() if max(w[0], w[2]) < 10.1]
    lines = lines_of("c1", floor_walls(), ["alice", "bob"], 0) + lines_of("c3", small, ["carol"], 1)
    keyframes = [
        KeyframeView(
            f"k{10 * i + k}",
            name,
            names[name],
            "0",
            60 * k,
            1e9 + 6.0 * k,
            Pose.from_array(trajectories[name].poses[60 * k]),
        )
        for i, name in enumerate(trajectories)
        for k in range(3)
    ]
    return SiteView(
        version=4242,
        robots=robots,
        components=(ComponentView("c1", ("alice", "bob"), 6), ComponentView("c3", ("carol",), 3)),
        merged_into={"c2": "c1"},
        trajectories=trajectories,
        lines=tuple(lines),
        keyframes=tuple(keyframes),
        constraints=tuple(constraints(keyframes)),
    )


def constraints(keyframes: list[KeyframeView]) -> list[ConstraintView]:
    information = np.array(
        [[1234.5678901234, 12.25, -3.5], [12.25, 987.6, 1 / 3], [-3.5, 1 / 3, 4e4]]
    )
    found = [
        ConstraintView(
            f"s{a.id[1:]}",
            "sequential",
            "accepted",
            a.id,
            b.id,
            a.pose.between(b.pose),
            information,
            "",
            "step",
            ScanName(a.robot, a.session, a.seq),
            ScanName(b.robot, b.session, b.seq),
        )
        for a, b in itertools.pairwise(keyframes)
        if a.robot == b.robot
    ]
    states: tuple[ConstraintState, ...] = ("accepted", "candidate", "rejected", "retracted")
    for k, state in enumerate(states):
        T = Pose(math.pi / 10 + k, 1e-7, -math.e / 3)
        a, b = keyframes[1], keyframes[4 + k % 2]
        scans = [ScanName(f.robot, f.session, f.seq) for f in (a, b)]
        found.append(
            ConstraintView(
                f"r{k}", "rendezvous", state, a.id, b.id, T, information, "test",
                "recognition", scans[0], scans[1],
            )
        )  # fmt: skip
    return found
