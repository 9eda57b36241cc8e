"""What must hold whatever the scene: determinism, self match, swapped scans, turned scans."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching import Matcher, match

from tests.lab.baselines.scenes import (
    ALL,
    POSE_FREE,
    STANDPOINTS,
    is_near,
    name_of,
    scans,
)

MOTION = Pose(0.3, 0.2, math.radians(12.0))


@pytest.mark.parametrize("matcher", ALL, ids=name_of)
def test_the_same_scans_give_the_same_answer(matcher: Matcher[Any]) -> None:
    pair = scans(STANDPOINTS[0], MOTION)
    first, second = match(matcher, *pair), match(type(matcher)(), *pair)
    assert first.best == second.best
    assert (first.verdict, first.score, first.checks) == (
        second.verdict,
        second.score,
        second.checks,
    )


@pytest.mark.parametrize("matcher", ALL, ids=name_of)
def test_a_scan_matches_itself_at_identity(matcher: Matcher[Any]) -> None:
    for here in STANDPOINTS:
        scan, _ = scans(here, MOTION)
        result = match(matcher, scan, scan)
        assert result.verdict == "match"
        assert is_near(result, Pose.identity(), 0.01, 0.1), result


@pytest.mark.parametrize("matcher", ALL, ids=name_of)
def test_scores_are_shares(matcher: Matcher[Any]) -> None:
    for here in STANDPOINTS:
        result = match(matcher, *scans(here, MOTION))
        assert 0.0 <= result.score <= 1.0
        assert all(math.isfinite(value) for value in result.checks.values())
        assert result.verdict in ("match", "none")


@pytest.mark.parametrize("matcher", POSE_FREE, ids=name_of)
def test_swapped_scans_give_the_inverse(matcher: Matcher[Any]) -> None:
    reference, current = scans(STANDPOINTS[2], MOTION)
    there, back = match(matcher, reference, current), match(matcher, current, reference)
    assert there.best is not None
    assert is_near(back, there.best.inverse(), 0.05, 0.7)


@pytest.mark.parametrize("degrees", [7, 90, 180])
@pytest.mark.parametrize("matcher", POSE_FREE, ids=name_of)
def test_turning_the_lidar_changes_the_answer_by_that_turn(
    matcher: Matcher[Any], degrees: int
) -> None:
    turn = math.radians(degrees)
    reference, current = scans(STANDPOINTS[0], MOTION)
    turned = replace(current, angle_min=current.angle_min + turn)
    straight, bent = match(matcher, reference, current), match(matcher, reference, turned)
    assert straight.best is not None
    assert is_near(bent, straight.best @ Pose(0.0, 0.0, -turn), 0.05, 0.5)


@pytest.mark.parametrize("matcher", ALL, ids=name_of)
def test_a_clockwise_sweep_is_the_same_scan(matcher: Matcher[Any]) -> None:
    reference, current = scans(STANDPOINTS[1], Pose(0.1, 0.0, 0.05))
    backwards = replace(
        current,
        ranges=np.ascontiguousarray(current.ranges[::-1]),
        angle_min=float(current.angles[-1]),
        angle_increment=-current.angle_increment,
    )
    straight, mirrored = match(matcher, reference, current), match(matcher, reference, backwards)
    assert straight.best is not None
    assert is_near(mirrored, straight.best, 0.01, 0.1)
