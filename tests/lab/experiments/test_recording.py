"""The simulated drives have the sizes that the text gives (§6.2, §6.3.2)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_lab.experiments.recording import closed_drive, closed_path, straight_run
from lineloom_lab.experiments.worlds import two_rooms, wall_corner


def test_the_closed_path_is_43_19_m_long_and_closes() -> None:
    drive = closed_drive(two_rooms())
    assert drive.length_m == pytest.approx(43.19, abs=1e-9)
    assert drive.start.distance(drive.legs[-1].end) < 1e-9
    assert abs(drive.start.between(drive.legs[-1].end).theta) < 1e-9


def test_the_floor_is_14_m_by_7_m_and_the_robot_keeps_clear_of_its_walls() -> None:
    recording = closed_path(0, 300)
    x0, y0, x1, y1 = recording.world.bounds
    assert (x1 - x0, y1 - y0) == pytest.approx((14.0, 7.0))
    assert min(recording.world.clearance(p.x, p.y) for p in recording.poses) > 0.3


@pytest.mark.parametrize("scans", [3069, 23])
def test_the_scans_lie_evenly_on_the_closed_path(scans: int) -> None:
    recording = closed_path(0, scans)
    assert len(recording) == scans
    steps = np.hypot(*np.diff(recording.positions, axis=0).T)
    # Chords of arcs are shorter than the way along them.
    assert steps.max() == pytest.approx(43.19 / (scans - 1), rel=1e-6)
    assert recording.poses[0].distance(recording.poses[-1]) < 1e-6


def test_a_part_of_the_path_keeps_the_distance_between_scans() -> None:
    part, whole = closed_path(0, 3069, 0.01), closed_path(0, 3069)
    assert len(part) == 32
    assert part.poses[-1].distance(whole.poses[31]) < 1e-6


def test_the_straight_run_is_18_65_m_without_a_turn() -> None:
    recording = straight_run(0)
    assert len(recording) == 1480
    assert recording.poses[0].distance(recording.poses[-1]) == pytest.approx(18.65)
    assert {pose.theta for pose in recording.poses} == {0.0}


def test_both_walls_fill_the_view_all_the_way() -> None:
    recording = straight_run(0, 20)
    assert all(np.isfinite(scan.ranges).all() for scan in recording.scans)
    directions = np.arctan2(*(wall_corner().walls[:, [3, 2]] - wall_corner().walls[:, [1, 0]]).T)
    assert abs(math.cos(directions[1] - directions[0])) < 1e-12


def test_the_seed_decides_the_noise() -> None:
    a, b, c = (straight_run(seed, 3).scans[1].ranges for seed in (5, 5, 6))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)
