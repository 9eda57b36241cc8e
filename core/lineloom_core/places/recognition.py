"""Deciding whether two places are the same, and how they lie to each other.

Steps of `recognise`: 1-6. the default matcher's, on fused lines and many sweeps, or, where lines
have too little in common, by the constellation of objects and corners (`landmarks`); 7. dense
registration of the best hypotheses; 8. margin to the best rival; 9. the verdict. A verdict of
"plausible" is a candidate, never yet a join: that takes several that agree (design §7).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.checks import RECOGNISED
from lineloom_core.codec import storable
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.graph.observability import observe
from lineloom_core.matching.free_space import TOLERANCE, TOLERANCE_SLOPE
from lineloom_core.matching.local_map import Registration
from lineloom_core.parameters import parameter
from lineloom_core.places import _constellation_kernels, _kernels
from lineloom_core.places.place import Place, count_points, count_steady
from lineloom_core.timing import timed


@storable("recognition-config")
@dataclass(frozen=True, slots=True)
class RecognitionConfig:
    """When two places are the same."""

    half: float = parameter(16.0, "m", "how far apart the places' anchors may lie", 0.1, 200.0)
    cell: float = parameter(0.25, "m", "of the vote for translations", 0.02)
    rotations: int = parameter(8, "hypotheses", "peaks of the histogram of rotations", 1, 1000)
    cells: int = parameter(12, "hypotheses", "cells of the vote for each rotation", 1, 1000)
    pair_limit: int = parameter(80, "pairs", "of lines that vote for each rotation", 1, 100_000)
    least_explained: float = parameter(
        5.0, "m", "of line that the best cell explains, else the places have nothing in common"
    )
    coarse_keep: int = parameter(
        16, "hypotheses", "that see the coarse check in free space", 1, 10_000
    )
    fine_keep: int = parameter(4, "hypotheses", "that see the full one", 1, 10_000)
    constellations: int = parameter(
        4, "hypotheses", "by objects and corners that see the full one", 1, 1000
    )
    most_conflict: float = parameter(
        0.1, "share", "of points in the other's free space, beyond what is in its own"
    )
    most_missing: float = parameter(
        0.05, "share", "of what stood still in one place that the other saw through"
    )
    least_matched: float = parameter(100.0, "points", "(cells of 0.1 m) that both saw")
    least_overlap: float = parameter(5.0, "m", "common length of lines")
    least_margin: float = parameter(
        0.15, "share", "of its evidence that the best hypothesis leads the best rival by"
    )
    least_information: float = parameter(
        6.0e3, "1/m²", "the least on the translation, points scaled as `Registration` does"
    )
    rival_distance: float = parameter(0.5, "m", "from which on a hypothesis is a rival")
    rival_angle: float = parameter(0.15, "rad", "from which on a hypothesis is a rival")


@storable("recognition")
@dataclass(frozen=True, eq=False)
class Recognition:
    """The outcome for a pair of places.

    T_reference_current: between the anchors. information: 3x3 over x, y, theta in the reference
    frame, points taken as independent. checks: figure by name.
    """

    plausible: bool
    T_reference_current: Pose | None
    information: NDArray[np.float64]
    reason: str
    evidence: float
    checks: dict[str, float] = field(default_factory=dict)


NOTHING_IN_COMMON = Recognition(False, None, np.zeros((3, 3)), "too little in common", 0.0)
"""The outcome for most pairs: no hypothesis at all."""


@timed("match")
def recognise(
    reference: Place, current: Place, config: RecognitionConfig | None = None
) -> Recognition:
    """Match two places without any pose and judge the best hypothesis."""
    config = config or RecognitionConfig()
    table = hypotheses(reference, current, config)
    if len(table) == 0:
        return NOTHING_IN_COMMON
    if evidence_of(table[0]) < config.least_overlap:
        return NOTHING_IN_COMMON
    registered = reference.register(current, Pose.from_array(table[0, :3]))
    checks = check_alignment(reference, current, registered)
    checks["overlap"], checks["objects"] = table[0, 9:11].tolist()
    evidence = evidence_for(checks["matched"], checks["conflict"], table[0, 9])
    checks["evidence"] = evidence
    rival = evidence_elsewhere(table, registered.pose, config)
    checks["margin"] = 1.0 - rival / evidence if evidence > 0.0 else 0.0
    checks["own_conflict"] = reference.own_conflict + current.own_conflict
    reason = RECOGNISED.objection(config, checks)
    if not reason:
        checks["missing_share"] = missing_share(*count_steady(reference, current, registered.pose))
        reason = RECOGNISED.objection(config, checks)
    return Recognition(
        plausible=reason == "",
        T_reference_current=registered.pose,
        information=registered.information,
        reason=reason or "all checks passed",
        evidence=evidence,
        checks=checks,
    )


def hypotheses(
    reference: Place, current: Place, config: RecognitionConfig | None = None
) -> NDArray[np.float64]:
    """Refined hypotheses (n, 11), best first: x, y, theta and figures (`_kernels.match_places`).

    The last is the number of objects that both saw, where it was by these and corners.
    """
    config = config or RecognitionConfig()
    table = _by_lines(reference, current, config)
    if len(table) and evidence_of(table[0]) >= config.least_overlap:
        return table
    table = np.concatenate([_by_landmarks(reference, current, config), table])
    ranked = sorted(table, key=evidence_of, reverse=True)
    return np.array(ranked).reshape(-1, 11)


def _by_lines(reference: Place, current: Place, config: RecognitionConfig) -> NDArray[np.float64]:
    if len(reference.lines) < 2 or len(current.lines) < 2:
        return np.empty((0, 11))
    table = _kernels.match_places(
        *_arrays(reference), *_arrays(current),
        config.rotations, config.cells, 0.25, config.pair_limit, config.cell, config.half, 0.3,
        config.least_explained, config.coarse_keep, config.fine_keep, 4,
        TOLERANCE, TOLERANCE_SLOPE,
    )  # fmt: skip
    return np.column_stack([table, np.zeros(len(table))])


def _by_landmarks(
    reference: Place, current: Place, config: RecognitionConfig
) -> NDArray[np.float64]:
    table: NDArray[np.float64] = _constellation_kernels.match_constellations(
        *_arrays(reference), *_arrays(current), reference.landmarks, current.landmarks,
        config.half, config.coarse_keep, config.constellations, 4, TOLERANCE, TOLERANCE_SLOPE,
    )  # fmt: skip
    return table


def _arrays(place: Place) -> tuple[NDArray[Any], ...]:
    """A place as the kernels take it."""
    return (
        place.lines, place.ends, place.edges, place.surface.points,
        place.ranges, place.angle_mins, place.angle_increments, place.sweep_poses,
    )  # fmt: skip


def check_alignment(reference: Place, current: Place, registered: Registration) -> dict[str, float]:
    """Free space both ways, fit and observability at a registered pose."""
    matched, conflict = count_points(reference, current, registered.pose)
    seen = observe(registered.information)
    return {
        "matched": matched,
        "conflict": conflict,
        "conflict_share": conflict / max(matched + conflict, 1.0),
        "fit": registered.fit,
        "information": seen.lambda_min,
        "isotropy": seen.lambda_min / max(seen.lambda_max, 1e-9),
    }


def missing_share(matched: float, missing: float) -> float:
    """Share of the steady points that the other place should have seen and did not, 0..1."""
    return missing / max(matched + missing, 1.0)


def evidence_for(matched: float, conflict: float, overlap: float = 0.0) -> float:
    """What speaks for an alignment, in metres of wall."""
    return float(_kernels.place_evidence(matched, conflict, overlap))


def evidence_of(row: NDArray[np.float64]) -> float:
    """What speaks for a hypothesis, in metres of wall."""
    return evidence_for(row[5], row[6], row[9])


def is_rival(a: Pose, b: Pose, config: RecognitionConfig, *, slack: float = 0.0) -> bool:
    """Whether two poses, give or take `slack` m, are two hypotheses rather than one."""
    turned = abs(angle_difference(a.theta, b.theta)) > config.rival_angle
    return turned or a.distance(b) > config.rival_distance + slack


def rivals(
    table: NDArray[np.float64], pose: Pose, config: RecognitionConfig, *, slack: float = 0.0
) -> tuple[NDArray[np.float64] | None, list[NDArray[np.float64]]]:
    """The best hypothesis at `pose` (give or take `slack` m), and those elsewhere, best first."""
    own, others = None, []
    for row in table:
        if is_rival(pose, Pose.from_array(row[:3]), config, slack=slack):
            others.append(row)
        elif own is None:
            own = row
    return own, others


def evidence_elsewhere(
    table: NDArray[np.float64], pose: Pose, config: RecognitionConfig, *, slack: float = 0.0
) -> float:
    """Evidence of the best hypothesis that is another relative pose than `pose`."""
    _, others = rivals(table, pose, config, slack=slack)
    return max((evidence_of(row) for row in others), default=0.0)
