"""The error of a merge: known motions and known mistakes must come out as they went in."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest
from lineloom.cli.truth import Truth, common_component, not_merged
from lineloom.client import Client
from lineloom.wire import Robot, ScanCounts, Trajectory, TrajectoryPose
from lineloom_core.geometry import Pose

T_MAP_WORLD = Pose(3.0, -7.0, 2.0)


def circle(robot: int, count: int = 60) -> list[Pose]:
    turns = [math.tau * n / count for n in range(count)]
    return [Pose(10.0 * robot + 4 * math.cos(t), 4 * math.sin(t), t + math.pi / 2) for t in turns]


def mapped(distort: Callable[[str, Pose], Pose]) -> tuple[Truth, Client]:
    """Two robots on circles in a map frame of its own, the poses distorted on the way."""
    truth = Truth()
    answers: dict[str, Trajectory] = {}
    for index, robot in enumerate(("a", "b")):
        poses = []
        for seq, true in enumerate(circle(index)):
            truth.note(robot, seq, (true.x, true.y, true.theta))
            seen = distort(robot, T_MAP_WORLD @ true)
            fields: dict[str, Any] = {"x": seen.x, "y": seen.y, "theta": seen.theta}
            component = "other" if seq == 7 else "c1"
            poses.append(
                TrajectoryPose(
                    session="0", seq=seq, stamp=float(seq), component=component, **fields
                )
            )
        answers[robot] = Trajectory(robot=robot, version=1, poses=poses)
    client = SimpleNamespace(trajectory=lambda site, robot: answers[robot])
    return truth, cast(Client, client)


def test_a_perfect_map_in_another_frame_has_no_error() -> None:
    truth, client = mapped(lambda robot, pose: pose)
    (error,) = truth.errors(client, "s", "c1")
    assert error.robots == ("a", "b")
    assert error.rmse == pytest.approx(0.0, abs=1e-9)
    assert error.max == pytest.approx(0.0, abs=1e-9)


def test_a_wrong_merge_shows_though_each_robot_is_right_by_itself() -> None:
    def shifted(robot: str, pose: Pose) -> Pose:
        along = T_MAP_WORLD.theta  # away from the other robot, which alignment cannot take out
        if robot == "a":
            return pose
        return Pose(pose.x + math.cos(along), pose.y + math.sin(along), pose.theta)

    truth, client = mapped(shifted)
    (error,) = truth.errors(client, "s", "c1")
    assert error.rmse == pytest.approx(0.5, abs=1e-6)
    assert error.max == pytest.approx(0.5, abs=1e-6)


def test_robots_are_merged_when_one_component_has_them_all() -> None:
    def robot(name: str, component: str | None) -> Robot:
        counts = ScanCounts(accepted=1, processed=1, pending=0)
        return Robot(
            robot=name, site="s", component=component, state="tracking", scans=counts, health=[]
        )

    assert common_component([robot("a", "c1"), robot("b", "c1")]) == "c1"
    assert common_component([robot("a", "c1"), robot("b", "c2")]) is None
    failure = not_merged({"c1": ["a"], "c2": ["b"]})
    assert failure.code == 4
    assert "2 components (a; b)" in str(failure)
