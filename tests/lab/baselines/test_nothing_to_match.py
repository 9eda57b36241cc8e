"""Scans without evidence get "none" and a reason, never an exception and never a pose."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching import Matcher, match
from lineloom_core.scan import Scan

from tests.lab.baselines.scenes import ALL, STANDPOINTS, name_of, scans


def sweep(ranges: Any) -> Scan:
    return Scan.checked(
        ranges,
        angle_min=-math.pi / 2,
        angle_increment=math.pi / 180,
        range_min=0.05,
        range_max=30.0,
        stamp=0.0,
    )


def lone_returns(count: int) -> Scan:
    ranges = np.full(181, np.nan)
    ranges[:: 181 // count][:count] = np.linspace(2.0, 9.0, count)
    return sweep(ranges)


EMPTY = {
    "nothing came back": sweep(np.full(181, np.inf)),
    "nothing was measured": sweep(np.full(181, np.nan)),
    "one return": lone_returns(1),
    "two returns": lone_returns(2),
}
FULL, _ = scans(STANDPOINTS[0], Pose.identity())


@pytest.mark.parametrize("empty", EMPTY.values(), ids=EMPTY.keys())
@pytest.mark.parametrize("matcher", ALL, ids=name_of)
def test_an_empty_scan_matches_nothing(matcher: Matcher[Any], empty: Scan) -> None:
    for pair in ((empty, FULL), (FULL, empty), (empty, empty)):
        result = match(matcher, *pair)
        assert result.verdict == "none"
        assert result.T_reference_current is None
        assert result.reason
        assert 0.0 <= result.score < 0.5


@pytest.mark.parametrize("matcher", ALL, ids=name_of)
def test_scattered_returns_are_survived(matcher: Matcher[Any]) -> None:
    rng = np.random.default_rng(2)
    clutter = sweep(rng.uniform(0.5, 10.0, 181))
    for pair in ((clutter, FULL), (FULL, clutter)):
        assert match(matcher, *pair).verdict == "none"


@pytest.mark.parametrize("matcher", ALL, ids=name_of)
def test_a_single_wall_is_survived(matcher: Matcher[Any]) -> None:
    bearings = -math.pi / 2 + math.pi / 180 * np.arange(181)
    with np.errstate(divide="ignore"):
        wall = sweep(np.where(np.abs(bearings) < 1.2, 2.0 / np.cos(bearings), np.inf))
    result = match(matcher, wall, wall)
    assert result.verdict in ("match", "none")
    assert result.reason
