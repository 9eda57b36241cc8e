"""Matchers of the literature, after the thesis's chapter 2: what the others do with two scans.

Compact and honest: each follows its source in what makes it what it is, names its departures at the
top of its file, and has a score of its own. None is calibrated: `least_score` is where about nine
answers of ten were right on simulated pairs.

point-to-line ([8], [12]) and idc ([18]) are iterative and need a guess: as pose-free matchers they
start from identity. The others need none: angle-histogram ([28]), common-subgraph ([5]),
complete-lines ([30]), angle-only ([3]), geometric-hashing ([26]).
"""

from lineloom_lab.baselines.angle_histogram import (
    AngleHistogramConfig,
    AngleHistogramMatcher,
)
from lineloom_lab.baselines.angle_only import AngleOnlyConfig, AngleOnlyMatcher
from lineloom_lab.baselines.common_subgraph import (
    CommonSubgraphConfig,
    CommonSubgraphMatcher,
)
from lineloom_lab.baselines.complete_lines import (
    CompleteLinesConfig,
    CompleteLinesMatcher,
)
from lineloom_lab.baselines.geometric_hashing import (
    GeometricHashingConfig,
    GeometricHashingMatcher,
)
from lineloom_lab.baselines.idc import IdcConfig, IdcMatcher
from lineloom_lab.baselines.point_to_line import PointToLineConfig, PointToLineMatcher

__all__ = [
    "AngleHistogramConfig",
    "AngleHistogramMatcher",
    "AngleOnlyConfig",
    "AngleOnlyMatcher",
    "CommonSubgraphConfig",
    "CommonSubgraphMatcher",
    "CompleteLinesConfig",
    "CompleteLinesMatcher",
    "GeometricHashingConfig",
    "GeometricHashingMatcher",
    "IdcConfig",
    "IdcMatcher",
    "PointToLineConfig",
    "PointToLineMatcher",
]
