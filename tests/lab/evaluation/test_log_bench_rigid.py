"""Two lidars on one robot, drawn by hand: the map must have them as they are mounted."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.geometry import Pose, se2
from lineloom_core.scan import Scan
from lineloom_lab.evaluation.log_bench_judge import PlacedRobot
from lineloom_lab.evaluation.log_bench_log import Recording, RigidPair, no_reference
from lineloom_lab.evaluation.log_bench_rigid import rigid_figures

MOUNTED = Pose(-0.9, 0.5, 2.3)
PAIR = RigidPair("left", "rear", MOUNTED)
TIMES = 0.1 * np.arange(30)


def way(times: np.ndarray) -> np.ndarray:
    return np.column_stack([0.5 * times, 0.05 * times**2, 0.1 * times])


def lidar(name: str, times: np.ndarray) -> Recording:
    scans = tuple(
        Scan.checked(
            [1.0, 2.0], angle_min=0.0, angle_increment=0.1, range_min=0.0, range_max=9.0, stamp=t
        )
        for t in times.tolist()
    )
    return Recording(name, scans, no_reference(len(scans)))


LEFT, REAR = lidar("left", TIMES), lidar("rear", TIMES + 0.03)
LEFT_POSES = way(TIMES)
REAR_POSES = se2.compose(way(TIMES + 0.03), MOUNTED.to_array())


def placed(name: str, poses: np.ndarray, component: str) -> PlacedRobot:
    return PlacedRobot(name, poses, np.full(len(poses), component), no_reference(len(poses)))


def test_lidars_that_lie_as_they_are_mounted_agree() -> None:
    found = rigid_figures(
        [LEFT, REAR], [placed("left", LEFT_POSES, "a"), placed("rear", REAR_POSES, "a")], PAIR
    )
    assert (found.compared, found.agreeing) == (29, 29)  # the last has no scan after it


def test_a_false_join_disagrees() -> None:
    moved = REAR_POSES.copy()
    moved[10:, 1] += 0.6
    found = rigid_figures(
        [LEFT, REAR], [placed("left", LEFT_POSES, "a"), placed("rear", moved, "a")], PAIR
    )
    assert (found.compared, found.agreeing) == (29, 10)
    assert found.share_agreeing == pytest.approx(10 / 29)


def test_lidars_apart_cannot_be_compared() -> None:
    found = rigid_figures(
        [LEFT, REAR], [placed("left", LEFT_POSES, "a"), placed("rear", REAR_POSES, "b")], PAIR
    )
    assert found.share_agreeing is None


def test_cut_recordings_are_compared_part_by_part() -> None:
    halves = [lidar("left-0", TIMES[:15]), lidar("left-1", TIMES[15:]), REAR]
    maps = [
        placed("left-0", LEFT_POSES[:15], "a"),
        placed("left-1", LEFT_POSES[15:], "a"),
        placed("rear", REAR_POSES, "a"),
    ]
    found = rigid_figures(halves, maps, PAIR)
    assert (found.compared, found.agreeing) == (28, 28)
