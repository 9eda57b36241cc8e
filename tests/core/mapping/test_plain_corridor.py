"""Between two endless plain walls nothing observes the position along them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.mapping.facts.tracker import Tracked, Tracker
from lineloom_core.matching.local_map import Cloud
from lineloom_lab.simulation import Lidar, World, sick_lms200

WALLS = World(np.array([[-80.0, 1.1, 80.0, 1.1], [80.0, -1.1, -80.0, -1.1]]))
SHORT_SIGHTED = Lidar(
    angle_min=-math.pi,
    angle_increment=math.tau / 720,
    beams=720,
    range_min=0.1,
    range_max=8.0,
    rate_hz=10.0,
)
LIDARS = pytest.mark.parametrize("lidar", [SHORT_SIGHTED, sick_lms200()], ids=["360", "sick"])


def follow(lidar: Lidar, poses: list[Pose], *, odometry: bool) -> list[Tracked]:
    rng = np.random.default_rng(0)
    tracker = Tracker()
    placed = []
    for k, pose in enumerate(poses):
        scan = lidar.scan(WALLS, pose, rng, stamp=0.1 * k, seq=k)
        features = extract_features(scan)
        wheels = pose if odometry else None
        placed.append(tracker.track(features, Cloud.of(features), scan.stamp, wheels))
    return placed


@pytest.mark.parametrize(
    ("lidar", "most"), [(SHORT_SIGHTED, 0.3), (sick_lms200(), 1.5)], ids=["360", "sick"]
)
def test_turning_on_the_spot_does_not_run_away(lidar: Lidar, most: float) -> None:
    """Noise may shift the robot, but gathers no speed: with momentum it went 4 to 6 m in a turn."""
    last = follow(lidar, [Pose(0.0, 0.0, 0.05 * k) for k in range(60)], odometry=False)[-1]
    assert last.pose is not None
    assert math.hypot(last.pose.x, last.pose.y) < most


@LIDARS
def test_wheels_know_the_way_along(lidar: Lidar) -> None:
    last = follow(lidar, [Pose(0.06 * k, 0.0, 0.0) for k in range(60)], odometry=True)[-1]
    assert last.pose is not None
    assert last.pose.distance(Pose(0.06 * 59, 0.0, 0.0)) < 0.1


@LIDARS
def test_the_step_claims_no_knowledge_along(lidar: Lidar) -> None:
    last = follow(lidar, [Pose(0.06 * k, 0.0, 0.0) for k in range(20)], odometry=True)[-1]
    (least, most), axes = np.linalg.eigh(last.information[:2, :2])
    assert least < 1e-12 * most
    # Along the walls as this scan sees them: its noise turns them by a tenth of a degree.
    assert abs(axes[1, 0]) < 0.003
