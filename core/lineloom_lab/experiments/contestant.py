"""The matchers that are put side by side, with the line segments each of them matches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from lineloom_core.features import EDGE, ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.matching import LineMatcher, Matcher
from lineloom_core.matching.matcher import MatcherConfig
from lineloom_core.matching.result import MatchResult
from lineloom_core.matching.thesis import Description, ThesisConfig, ThesisMatcher
from lineloom_core.matching.thesis.line_segments import LineSegments
from numpy.typing import NDArray

from lineloom_lab.evaluation.error_area import ErrorArea, error_area


@dataclass(frozen=True, slots=True)
class Contestant:
    """A matcher under test.

    key: "thesis" or "default". label: for tables. colour: in figures. segments: the list L of
    what `matcher.prepare` returned, in the laser's frame [m].
    """

    key: str
    label: str
    colour: str
    matcher: Matcher[Any]
    segments: Callable[[Any], LineSegments]

    def area(self, reference: Any, current: Any, pairs: MatchResult, pose: Pose) -> ErrorArea:
        """Error area (§6.3) of the matching pairs under `pose`, T_reference_current, [m^2]."""
        return error_area(
            rows(self.segments(reference)),
            rows(self.segments(current)),
            [(pair.reference, pair.current) for pair in pairs.pairs],
            pose,
        )


def thesis_contestant(*, order_extension: bool = False) -> Contestant:
    """The thesis's matcher (chapters 3 to 5); §5.7's extension is for small pose differences."""

    def segments(prepared: Any) -> LineSegments:
        return cast("Description", prepared).primitives.L

    matcher = ThesisMatcher(ThesisConfig(order_extension=order_extension))
    return Contestant("thesis", "thesis's matcher", "#d55e00", matcher, segments)


def default_contestant(*, reach: float = 10.0) -> Contestant:
    """The default matcher (design §5); reach: greatest translation it looks for [m]."""

    def segments(prepared: Any) -> LineSegments:
        features = cast("ScanFeatures", prepared)
        ends = [(bool(s), bool(e)) for s, e in (features.ends == EDGE).tolist()]
        return LineSegments.of(features.lines[:, :4], ends)

    return Contestant(
        "default", "default matcher", "#0072b2", LineMatcher(MatcherConfig(half=reach)), segments
    )


def rows(L: LineSegments) -> NDArray[np.float64]:
    """Line segments as rows x1, y1, x2, y2 [m], (n, 4)."""
    return np.hstack([L.s, L.e])


def answer_of(result: MatchResult) -> Pose | None:
    """The T_reference_current that is used, whatever the verdict: Algorithm 5 never declines."""
    return result.T_reference_current or result.best
