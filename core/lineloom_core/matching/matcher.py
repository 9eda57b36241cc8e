"""The default matcher: two scans, no pose, an honest answer (design §5).

Steps: 1-3. rotations by the histogram of direction differences, translations by votes of line
pairs, ranking by explained length; 4. refinement; 5. free space both ways; 6. observability;
7. uniqueness; 8. calibrated score. Steps 1 to 5 run in one kernel (`_kernels.match_sweeps`).
Columns and round rooms take part in steps 1 to 4 where both scans show them: centres coincide, and
their distances to lines and to each other name rotations (`_circle_match_kernels`).
Where no full pose convinces, two scans of one corridor may still share its walls (`band`).

Beyond the thesis (chapters 4 and 5): directions are compared first and translations are voted
for, instead of counting equal relations in a matching table; every hypothesis is verified
against what both scans saw through, and the answer may be "weak" or "ambiguous".
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import ExtractionConfig, ScanFeatures, extract_features
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.matching import _kernels, _proposal_kernels
from lineloom_core.matching._circle_match_kernels import circle_pairs
from lineloom_core.matching.band import Band, as_band, band_hypotheses
from lineloom_core.matching.covariance import pose_covariance
from lineloom_core.matching.free_space import TOLERANCE, TOLERANCE_SLOPE
from lineloom_core.matching.result import Alternative, LinePair, MatchResult, Verdict
from lineloom_core.matching.score import probability
from lineloom_core.scan import Scan

Row = list[float]
"""A hypothesis as `_kernels.match_sweeps` gives it."""
X, Y, ANGLE, EXPLAINED, VOTES, MATCHED, CONFLICT, OCCLUDED, OUTSIDE, OVERLAP = range(10)


@dataclass(frozen=True, slots=True)
class MatcherConfig:
    """Parameters of the default matcher; metres, radians, shares 0..1.

    rotations, least_share: peaks of the histogram kept, and the least height against the best.
    cells, cell, half: translation cells kept per rotation, their size, greatest translation.
    pair_limit: line pairs per rotation. reach: how far off a line explains another before
    refinement. coarse_keep, fine_keep: hypotheses that see the coarse and the full free-space
    check. weak_below: information [1/m^2] under which a direction is weak; turn_below: the same
    of the rotation [1/rad^2]. per_circle: rotations tried per pair of circles. rival_distance,
    rival_angle: what counts as another place. least_margin: lead over the rival. most_conflict,
    least_evidence: what a hypothesis must show to be one.
    least_score: how sure a "match" must be.
    """

    rotations: int = 8
    least_share: float = 0.25
    cells: int = 12
    pair_limit: int = 120
    cell: float = 0.2
    half: float = 10.0
    reach: float = 0.25
    coarse_keep: int = 24
    fine_keep: int = 8
    iterations: int = 3
    weak_below: float = 300.0
    turn_below: float = 400.0
    per_circle: int = 4
    rival_distance: float = 0.3
    rival_angle: float = 0.15
    least_margin: float = 0.15
    most_conflict: float = 0.25
    least_evidence: float = 3.0
    least_score: float = 0.7
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)


class LineMatcher:
    """Matches pairs of scans; holds nothing but its parameters."""

    def __init__(self, config: MatcherConfig | None = None) -> None:
        self.config = config or MatcherConfig()

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "lineloom"

    def match(self, reference: Scan, current: Scan) -> MatchResult:
        """Find T_reference_current of two scans without any initial guess."""
        return self.match_prepared(self.prepare(reference), self.prepare(current))

    def prepare(self, scan: Scan) -> ScanFeatures:
        """Extract the features of one scan."""
        return extract_features(scan, self.config.extraction)

    def match_prepared(self, reference: ScanFeatures, current: ScanFeatures) -> MatchResult:
        """Match features that have been extracted already."""
        r, c = _comparable(reference, current)
        result = self._match(r, c)
        pose = result.T_reference_current or result.best
        if (r is reference and c is current) or pose is None:
            return result
        return replace(result, pairs=line_pairs(reference, current, pose))

    def _match(self, reference: ScanFeatures, current: ScanFeatures) -> MatchResult:
        """Full poses first; where none convinces, the parallel walls that both saw."""
        if min(_primitives(reference), _primitives(current)) < 2:
            return _none("fewer than two line segments in a scan, and no circle")
        table = self._hypotheses(reference, current)
        result = self._decide(reference, current, table)
        if result.verdict != "none":
            return result
        bands = band_hypotheses(reference, current)
        if len(bands) == 0:
            return result
        result = self._decide(reference, current, _by_evidence(table, bands))
        if result.verdict in {"match", "ambiguous"}:
            return result
        band = next((b for b in map(as_band, bands) if b.convincing), None)
        if band is None:
            return _unsure(result)
        pose, along = band.T_reference_current, band.direction
        covariance = pose_covariance(reference, current, pose, along)
        return _as_weak(result, band, covariance, line_pairs(reference, current, pose))

    def _decide(
        self, reference: ScanFeatures, current: ScanFeatures, table: NDArray[np.float64]
    ) -> MatchResult:
        """Steps 6 to 8 on a table of hypotheses, best first."""
        if len(table) == 0:
            return _none("no rotation and translation that two line pairs agree on")
        rows: list[Row] = table.tolist()  # some fifteen numbers: plain floats are quicker here
        best = rows[0]
        pose = Pose(best[X], best[Y], best[ANGLE])
        information = best[10:16]
        turn = _turn_information(information)
        weak_direction, lambda_min = _weakness(information, self.config.weak_below)
        if turn < self.config.turn_below:
            weak_direction = None  # it turns, so that no straight slide describes it
        rivals = self._rivals(rows, pose, weak_direction)
        checks = {**_checks(best, rivals, lambda_min), "turn_information": turn}
        score = probability(checks)
        verdict, reason = self._verdict(checks, score, weak_direction)
        return MatchResult(
            verdict=verdict,
            T_reference_current=None if verdict == "none" else pose,
            weak_direction=weak_direction if verdict == "weak" else None,
            covariance=None
            if verdict == "none"
            else pose_covariance(reference, current, pose, weak_direction),
            score=score,
            reason=reason,
            best=pose,
            pairs=line_pairs(reference, current, pose),
            checks=checks,
            alternatives=tuple(
                Alternative(Pose(r[X], r[Y], r[ANGLE]), score * _ratio(r, best)) for r in rivals
            ),
        )

    def _hypotheses(self, r: ScanFeatures, c: ScanFeatures) -> NDArray[np.float64]:
        k = self.config
        limits = (
            k.rotations, k.cells, k.least_share, k.pair_limit, k.cell, k.half, k.reach,
            k.coarse_keep, k.fine_keep, k.iterations, TOLERANCE, TOLERANCE_SLOPE,
        )  # fmt: skip
        table: NDArray[np.float64]
        if len(r.circles) and len(c.circles):
            table = _kernels.match_round_sweeps(
                r.lines, r.ends, r.edges, r.circles,
                r.points, r.ranges, r.angle_min, r.angle_increment,
                c.lines, c.ends, c.edges, c.circles,
                c.points, c.ranges, c.angle_min, c.angle_increment, *limits, k.per_circle,
            )  # fmt: skip
            return table
        table = _kernels.match_sweeps(
            r.lines, r.ends, r.edges, r.points, r.ranges, r.angle_min, r.angle_increment,
            c.lines, c.ends, c.edges, c.points, c.ranges, c.angle_min, c.angle_increment, *limits,
        )  # fmt: skip
        return table

    def _rivals(self, rows: list[Row], best: Pose, weak_direction: float | None) -> list[Row]:
        """Hypotheses that are another place; a slide along a weak direction is the same one."""
        found = []
        for row in rows[1:]:
            dx, dy = row[X] - best.x, row[Y] - best.y
            if weak_direction is None:
                apart = math.hypot(dx, dy)
            else:
                apart = abs(dy * math.cos(weak_direction) - dx * math.sin(weak_direction))
            turned = abs(angle_difference(row[ANGLE], best.theta))
            if apart > self.config.rival_distance or turned > self.config.rival_angle:
                found.append(row)
        return found

    def _verdict(
        self, checks: dict[str, float], score: float, weak_direction: float | None
    ) -> tuple[Verdict, str]:
        config = self.config
        if checks["evidence"] < config.least_evidence:
            return "none", f"only {checks['evidence']:.1f} m of wall speak for the best hypothesis"
        if checks["conflict_share"] > config.most_conflict:
            share = 100.0 * checks["conflict_share"]
            return "none", f"{share:.0f} % of what both saw contradicts the best hypothesis"
        if checks["turn_information"] < config.turn_below:
            return "ambiguous", "nothing seen by both fixes the rotation about what is round"
        if checks["margin"] < config.least_margin:
            return "ambiguous", "another hypothesis fits almost as well"
        if weak_direction is not None:
            return "weak", "nothing seen by both fixes the position along one direction"
        if score < config.least_score:
            return "none", f"the best hypothesis is right with a probability of only {score:.2f}"
        return "match", "all checks passed"


def _comparable(r: ScanFeatures, c: ScanFeatures) -> tuple[ScanFeatures, ScanFeatures]:
    """Where both show a circle that may be one, it stands for its chords; else lines alone."""
    if len(r.circles) and len(c.circles) and len(circle_pairs(r.circles, c.circles)):
        return r.straight(), c.straight()
    return r, c


def _primitives(f: ScanFeatures) -> int:
    """How much a scan has to match: a circle is worth two lines, which fix a point as well."""
    return len(f) + 2 * len(f.circles)


def _by_evidence(table: NDArray[np.float64], bands: NDArray[np.float64]) -> NDArray[np.float64]:
    """Both kinds of hypotheses in one table, best first; equals keep their order."""
    joined = np.vstack([table, bands[:, : table.shape[1]]])
    rank = joined[:, OVERLAP] + joined[:, MATCHED] - 3.0 * joined[:, CONFLICT]
    ordered: NDArray[np.float64] = joined[np.argsort(-rank, kind="stable")]
    return ordered


def _unsure(result: MatchResult) -> MatchResult:
    """A lone wall may be any wall: not even a weak answer."""
    if result.verdict != "weak":
        return result
    return replace(
        result,
        verdict="none",
        T_reference_current=None,
        weak_direction=None,
        covariance=None,
        reason="too little is shared to tell one wall from another",
    )


def _as_weak(
    result: MatchResult,
    band: Band,
    covariance: NDArray[np.float64],
    pairs: tuple[LinePair, ...],
) -> MatchResult:
    """The same two parallel walls are an answer where no full pose convinces."""
    return replace(
        result,
        verdict="weak",
        T_reference_current=band.T_reference_current,
        weak_direction=band.direction,
        covariance=covariance,
        reason="only parallel walls are shared: the position along them is not known",
        pairs=pairs,
        checks={**result.checks, **band.checks()},
    )


def line_pairs(reference: ScanFeatures, current: ScanFeatures, pose: Pose) -> tuple[LinePair, ...]:
    """Line segments that lie on each other under `pose`, by extraction numbers."""
    rows = _proposal_kernels.lying_pairs(
        reference.lines, current.lines, pose.to_array(), math.radians(5.0), 0.12, 0.1
    )
    return tuple(LinePair(int(i), int(j), o, d, a) for i, j, o, d, a in rows.tolist())


def _weakness(information: Row, weak_below: float) -> tuple[float | None, float]:
    """Weak direction [rad, 0..pi) or None, and the least eigenvalue of the translation's Schur
    complement [1/m^2]. information: the upper triangle, row by row.
    """
    a, b, c, d, e, f = information
    f = max(f, 1e-9)
    xx, xy, yy = a - c * c / f, b - c * e / f, d - e * e / f
    least = 0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy)
    if least >= weak_below:
        return None, least
    strong = 0.5 * math.atan2(2.0 * xy, xx - yy)  # the axis of the greater eigenvalue
    return (strong + 0.5 * math.pi) % math.pi, least


def _turn_information(information: Row) -> float:
    """Information [1/rad^2] of the rotation while the translation is not known."""
    a, b, c, d, e, f = information
    a, d = a + 0.01, d + 0.01  # where nothing fixes a translation it says nothing of the rotation
    det = a * d - b * b
    return f - (d * c * c - 2.0 * b * c * e + a * e * e) / det


def _evidence(row: Row) -> float:
    """As `_kernels.evidence`: metres of wall that speak for a hypothesis."""
    return row[OVERLAP] + row[MATCHED] - 3.0 * row[CONFLICT]


def _checks(best: Row, rivals: list[Row], lambda_min: float) -> dict[str, float]:
    evidence = _evidence(best)
    rival = max((_evidence(r) for r in rivals), default=0.0)
    judged = max(best[MATCHED] + best[CONFLICT], 1e-9)
    return {
        "evidence": evidence,
        "rival_evidence": max(rival, 0.0),
        "margin": 1.0 - max(rival, 0.0) / evidence if evidence > 0.0 else 0.0,
        "overlap_m": best[OVERLAP],
        "matched_m": best[MATCHED],
        "conflict_m": best[CONFLICT],
        "conflict_share": best[CONFLICT] / judged,
        "matched_share": best[MATCHED] / (judged + best[OCCLUDED]),
        "information": lambda_min,
    }


def _ratio(rival: Row, best: Row) -> float:
    top = _evidence(best)
    return min(max(_evidence(rival) / top, 0.0), 1.0) if top > 0.0 else 0.0


def _none(reason: str) -> MatchResult:
    return MatchResult("none", None, None, None, 0.0, reason)
