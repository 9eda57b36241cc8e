"""The default matcher: two scans, no pose, an honest answer (design §5).

Steps: 1-3. rotations by the histogram of direction differences, translations by votes of line
pairs, ranking by explained length; 4. refinement; 5. free space both ways; 6. slides: where votes
leave a doubt, parallel walls are slid along each other; 7. the rivals of the best hypothesis;
8. calibrated probabilities. Steps 1 to 7 run in one kernel (`_kernels.match_sweeps`).
Columns and round rooms take part in steps 1 to 4 where both scans show them: centres coincide, and
their distances to lines and to each other name rotations (`_circle_match_kernels`).

Beyond the thesis (chapters 4 and 5): directions are compared first and translations are voted
for, instead of counting equal relations in a matching table; every hypothesis is verified
against what both scans saw through, and the answer may be "weak" or "ambiguous".
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import ExtractionConfig, ScanFeatures, extract_features
from lineloom_core.geometry import Pose
from lineloom_core.matching import _agreement_kernels as _agreement
from lineloom_core.matching import _hypothesis, _kernels, _proposal_kernels
from lineloom_core.matching._circle_match_kernels import circle_pairs
from lineloom_core.matching._hypothesis import CONFLICT, INFORMATION, MATCHED, OVERLAP
from lineloom_core.matching._sweep import Search, Sweep
from lineloom_core.matching.covariance import Claim, pose_covariance
from lineloom_core.matching.result import Alternative, LinePair, MatchResult, Verdict
from lineloom_core.matching.score import Belief, believe
from lineloom_core.scan import Scan

_CLAIMS: dict[Verdict, Claim] = {"match": "found", "weak": "weak"}


@dataclass(frozen=True, slots=True)
class MatcherConfig:
    """Parameters of the default matcher; metres, radians, shares 0..1.

    rotations, least_share: peaks of the histogram kept, and the least height against the best.
    cells, cell, half: translation cells kept per rotation, their size, greatest translation.
    pair_limit: line pairs per rotation. reach: how far off a line explains another before
    refinement. coarse_keep, fine_keep: hypotheses that see the coarse and the full free-space
    check. per_circle: rotations tried per pair of circles. turn_below: information of the rotation
    [1/rad^2] under which it is not known. least_margin: lead over another place. most_unrefuted:
    share of the best one's evidence that another place may have which nothing contradicts.
    most_conflict, least_evidence: what a hypothesis must show to be one. least_score: how sure a
    "match" must be. least_belief: how sure of its rotation and position across a "weak" one must
    be; most_slide: and how unsure of the position along at least.
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
    turn_below: float = 400.0
    per_circle: int = 4
    least_margin: float = 0.15
    most_unrefuted: float = 0.5
    most_conflict: float = 0.35
    least_evidence: float = 1.5
    least_score: float = 0.85
    least_belief: float = 0.5
    most_slide: float = 0.9
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)

    def search(self) -> Search:
        """What the kernels take of this."""
        return Search(
            self.rotations, self.cells, self.least_share, self.pair_limit, self.cell, self.half,
            self.reach, self.coarse_keep, self.fine_keep, self.iterations, self.per_circle,
        )  # fmt: skip


class LineMatcher:
    """Matches pairs of scans; holds nothing but its parameters."""

    def __init__(self, config: MatcherConfig | None = None) -> None:
        self.config = config or MatcherConfig()
        self._search = self.config.search()

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
        if (r is reference and c is current) or result.best is None:
            return result
        return replace(result, pairs=line_pairs(reference, current, result.best))

    def _match(self, reference: ScanFeatures, current: ScanFeatures) -> MatchResult:
        if min(_primitives(reference), _primitives(current)) < 2:
            return _none("fewer than two line segments in a scan, and no circle")
        r, c = Sweep.of(reference), Sweep.of(current)
        table, figures = _kernels.match_sweeps(r, c, self._search)
        if len(table) == 0:
            return _none("no rotation and translation that two line pairs agree on")
        checks = _checks(table[0], figures)
        belief = believe(checks)
        verdict, reason = self._verdict(checks, belief)
        axis = checks["axis"]
        pose = Pose.from_array(table[0, :3])
        known = verdict != "none"
        claim = _CLAIMS.get(verdict, "lines")
        return MatchResult(
            verdict=verdict,
            T_reference_current=pose if known else None,
            weak_direction=axis if verdict == "weak" else None,
            covariance=pose_covariance(r, c, pose, axis, claim) if known else None,
            score=belief.full,
            reason=reason,
            best=pose,
            pairs=line_pairs(reference, current, pose),
            checks=checks,
            alternatives=_alternatives(table, belief.full, axis if verdict == "weak" else None),
        )

    def _verdict(self, checks: dict[str, float], belief: Belief) -> tuple[Verdict, str]:
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
        if checks["unrefuted_share"] > config.most_unrefuted:
            return "ambiguous", "another hypothesis explains less, but nothing contradicts it"
        if belief.full >= config.least_score and checks["slide_margin"] >= config.least_margin:
            return "match", "all checks passed"
        if belief.family >= config.least_belief and belief.slide <= config.most_slide:
            return "weak", "nothing seen by both fixes the position along one direction"
        return "none", f"the best hypothesis is right with a probability of only {belief.full:.2f}"


def _comparable(r: ScanFeatures, c: ScanFeatures) -> tuple[ScanFeatures, ScanFeatures]:
    """Where both show a circle that may be one, it stands for its chords; else lines alone."""
    if len(r.circles) and len(c.circles) and len(circle_pairs(r.circles, c.circles)):
        return r.straight(), c.straight()
    return r, c


def _primitives(f: ScanFeatures) -> int:
    """How much a scan has to match: a circle is worth two lines, which fix a point as well."""
    return len(f) + 2 * len(f.circles)


def line_pairs(reference: ScanFeatures, current: ScanFeatures, pose: Pose) -> tuple[LinePair, ...]:
    """Line segments that lie on each other under `pose`, by extraction numbers."""
    rows = _proposal_kernels.lying_pairs(
        reference.lines, current.lines, pose.to_array(),
        _agreement.LYING_ANGLE, _agreement.LYING_DISTANCE, _agreement.LYING_OVERLAP,
    )  # fmt: skip
    return tuple(LinePair(int(i), int(j), o, d, a) for i, j, o, d, a in rows.tolist())


def _checks(best: NDArray[np.float64], figures: NDArray[np.float64]) -> dict[str, float]:
    """The figures behind the answer, by name; metres, shares, information in 1/m^2, 1/rad^2."""
    row, f = best.tolist(), figures.tolist()
    information = row[INFORMATION:]
    matched, conflict = row[MATCHED], row[CONFLICT]
    occluded, outside = row[_hypothesis.OCCLUDED], row[_hypothesis.OUTSIDE]
    evidence = max(f[_agreement.BEST], 1e-9)
    rival, slide = max(f[_agreement.OTHER], 0.0), max(f[_agreement.SLIDE], 0.0)
    least, _ = _hypothesis.translation_information(*information)
    return {
        "evidence": f[_agreement.BEST],
        "rival_evidence": rival,
        "unrefuted_evidence": max(f[_agreement.UNREFUTED], 0.0),
        "slide_evidence": slide,
        "margin": 1.0 - rival / evidence,
        "unrefuted_share": max(f[_agreement.UNREFUTED], 0.0) / evidence,
        "slide_margin": 1.0 - slide / evidence,
        "overlap_m": row[OVERLAP],
        "matched_m": matched,
        "conflict_m": conflict,
        "conflict_share": conflict / max(matched + conflict, 1e-9),
        "matched_share": matched / max(matched + conflict + occluded, 1e-9),
        "seen_share": matched / max(matched + conflict + occluded + outside, 1e-9),
        "walls": f[_agreement.WALLS],
        "weaker_m": f[_agreement.LEAN],
        "stronger_m": f[_agreement.BROAD],
        "facing_m": f[_agreement.FACING],
        "information": least,
        "turn_information": _hypothesis.turn_information(*information),
        "axis": f[_agreement.AXIS],
    }


def _alternatives(
    table: NDArray[np.float64], score: float, axis: float | None
) -> tuple[Alternative, ...]:
    """The rivals, best first; for a weak answer, slides along `axis` are the same one."""
    best = table[0]
    top = _hypothesis.evidence(best)
    found = []
    for row in table[1:]:
        same = axis is not None and _agreement.is_slide(row, best, axis)
        if not same and _agreement.is_apart(row, best):
            share = min(max(_hypothesis.evidence(row) / top, 0.0), 1.0) if top > 0.0 else 0.0
            found.append(Alternative(Pose.from_array(row[:3]), score * share))
    return tuple(found)


def _none(reason: str) -> MatchResult:
    return MatchResult("none", None, None, None, 0.0, reason)
