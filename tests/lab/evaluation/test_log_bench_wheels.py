"""Wheels alone as a measure, on odometry made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan
from lineloom_lab.evaluation.log_bench_log import Recording
from lineloom_lab.evaluation.log_bench_wheels import is_worse, wheels_rmse

WAY = np.column_stack([0.5 * np.arange(20), np.zeros(20), np.zeros(20)])


def driven(wheels: list[Pose | None], reference: np.ndarray = WAY) -> Recording:
    scans = tuple(
        Scan.checked(
            [1.0], angle_min=0.0, angle_increment=0.1, range_min=0.0, range_max=9.0,
            stamp=0.1 * i, seq=i, odometry=pose,
        )
        for i, pose in enumerate(wheels)
    )  # fmt: skip
    return Recording("r", scans, reference)


def test_wheels_that_are_right_in_their_own_frame_have_no_error() -> None:
    right: list[Pose | None] = [Pose(3.0, 1.0 + x, 1.57) for x in WAY[:, 0]]
    assert wheels_rmse([driven(right), driven(right)]) == pytest.approx(0.0, abs=1e-9)


def test_each_robot_is_aligned_by_itself_and_counts_by_its_scans() -> None:
    right: list[Pose | None] = [Pose(x, 0.0, 0.0) for x in WAY[:, 0]]
    off: list[Pose | None] = [Pose(x, 0.4 * (-1) ** i, 0.0) for i, x in enumerate(WAY[:, 0])]
    alone = wheels_rmse([driven(off)])
    assert alone == pytest.approx(0.4, rel=0.02)  # the rest is a turn that takes some of it up
    both = wheels_rmse([driven(off), driven(right)])
    assert both == pytest.approx(alone / np.sqrt(2.0))


def test_without_wheels_or_reference_nothing_is_said() -> None:
    assert wheels_rmse([driven([None] * 20)]) is None
    unknown = np.full_like(WAY, np.nan)
    assert wheels_rmse([driven([Pose(0.0, 0.0, 0.0)] * 20, unknown)]) is None
    half: list[Pose | None] = [None, *(Pose(x, 0.0, 0.0) for x in WAY[1:, 0])]
    assert wheels_rmse([driven(half)]) == pytest.approx(0.0, abs=1e-9)


def test_a_map_may_be_two_centimetres_and_five_percent_worse() -> None:
    assert not is_worse(0.124, 0.1)
    assert is_worse(0.126, 0.1)
    assert not is_worse(None, 0.1)
    assert not is_worse(9.0, None)
