"""Every baseline finds a small motion; those meant for it find large ones and half turns."""

from __future__ import annotations

import math
from typing import Any

import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching import Matcher, match

from tests.lab.baselines.scenes import (
    ALL,
    ITERATIVE,
    POSE_FREE,
    STANDPOINTS,
    half_turn_scans,
    is_near,
    name_of,
    scans,
)

SMALL = Pose(0.1, 0.05, math.radians(4.0))
LARGE = Pose(0.7, -0.4, math.radians(40.0))
ABOUT_FACE = Pose(0.0, 0.0, math.radians(150.0))


@pytest.mark.parametrize("here", STANDPOINTS)
@pytest.mark.parametrize("matcher", ALL, ids=name_of)
def test_a_small_motion_is_found(matcher: Matcher[Any], here: Pose) -> None:
    result = match(matcher, *scans(here, SMALL))
    assert result.verdict == "match", result.reason
    assert result.T_reference_current == result.best
    assert is_near(result, SMALL, 0.05, 1.0), result


@pytest.mark.parametrize("matcher", [m for m in ALL if m.name != "complete-lines"], ids=name_of)
def test_a_small_motion_is_found_with_a_view_of_180_degrees(matcher: Matcher[Any]) -> None:
    for here in STANDPOINTS:
        result = match(matcher, *half_turn_scans(here, SMALL))
        assert is_near(result, SMALL, 0.1, 1.5), (here, result)


@pytest.mark.parametrize("motion", [LARGE, ABOUT_FACE], ids=["large", "about-face"])
@pytest.mark.parametrize("matcher", POSE_FREE, ids=name_of)
def test_a_large_motion_is_found_without_a_guess(matcher: Matcher[Any], motion: Pose) -> None:
    for here in STANDPOINTS:
        result = match(matcher, *scans(here, motion))
        assert is_near(result, motion, 0.1, 1.5), (here, result)


@pytest.mark.parametrize("matcher", ITERATIVE, ids=name_of)
def test_iterative_matchers_find_a_large_motion_from_a_good_guess(matcher: Any) -> None:
    guess = Pose(LARGE.x + 0.12, LARGE.y - 0.1, LARGE.theta + math.radians(6.0))
    for here in STANDPOINTS:
        reference, current = (matcher.prepare(scan) for scan in scans(here, LARGE))
        assert is_near(matcher.match_from(reference, current, guess), LARGE, 0.05, 1.0)


@pytest.mark.parametrize("matcher", ITERATIVE, ids=name_of)
def test_iterative_matchers_from_identity_lose_their_way_and_know_it(matcher: Any) -> None:
    for here in STANDPOINTS:
        result = match(matcher, *scans(here, ABOUT_FACE))
        assert not is_near(result, ABOUT_FACE, 0.3, 5.0)
        assert result.verdict == "none"
        assert "scores" in result.reason
