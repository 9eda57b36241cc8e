"""Matching on this machine, with the core: the answer is the same type as the service's."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING

from lineloom.cli.failure import CommandError
from lineloom.scan_like import ScanLike, to_match_scan
from lineloom.wire import Alternative, LinePair, MatchAnswer, PoseAnswer

if TYPE_CHECKING:
    from lineloom_core.geometry import Pose
    from lineloom_core.matching.result import MatchResult
    from lineloom_core.scan import Scan


def match_locally(reference: ScanLike, current: ScanLike) -> MatchAnswer | None:
    """Return the match, or None where the core is not installed."""
    try:
        from lineloom_core.matching.matcher import LineMatcher
    except ImportError:
        return None
    return _answer(LineMatcher().match(_core_scan(reference, "A"), _core_scan(current, "B")))


def _core_scan(scan: ScanLike, name: str) -> Scan:
    from lineloom_core.scan import InvalidScanError, Scan

    if isinstance(scan, Scan):
        return scan
    wire = to_match_scan(scan)
    try:
        return Scan.checked(
            wire.ranges,
            angle_min=wire.angle_min,
            angle_increment=wire.angle_increment,
            angle_max=wire.angle_max,
            range_min=wire.range_min,
            range_max=wire.range_max,
            stamp=wire.stamp,
        )
    except InvalidScanError as error:
        raise CommandError(f"scan {name}: {error}") from None


def _answer(result: MatchResult) -> MatchAnswer:
    covariance = None
    if result.covariance is not None:
        covariance = [[_finite(value) for value in row] for row in result.covariance.tolist()]
    return MatchAnswer(
        verdict=result.verdict,
        T_reference_current=_pose(result.T_reference_current),
        weak_direction=result.weak_direction,
        covariance=covariance,
        score=result.score,
        pairs=[LinePair(**asdict(pair)) for pair in result.pairs],
        checks={name: _finite(value) for name, value in result.checks.items()},
        alternatives=list(_alternatives(result)),
        reason=result.reason,
    )


def _alternatives(result: MatchResult) -> Iterable[Alternative]:
    for other in result.alternatives:
        pose = other.T_reference_current
        yield Alternative(x=pose.x, y=pose.y, theta=pose.theta, score=other.score)


def _pose(pose: Pose | None) -> PoseAnswer | None:
    return None if pose is None else PoseAnswer(x=pose.x, y=pose.y, theta=pose.theta)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
