"""The thesis's matcher: chapters 3 to 5 behind the interface that all matchers share."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import extract_features
from lineloom_core.geometry import angle_difference
from lineloom_core.matching.result import Alternative, LinePair, MatchResult, Verdict
from lineloom_core.matching.thesis.alignment import Alignment, align
from lineloom_core.matching.thesis.config import ThesisConfig
from lineloom_core.matching.thesis.consistency import consistency_tables
from lineloom_core.matching.thesis.distinguishability import count, matching_relations
from lineloom_core.matching.thesis.matching_table import MatchingTable, compute_scores
from lineloom_core.matching.thesis.pairs import Match, MatchingPairs, find_matching_line_segments
from lineloom_core.matching.thesis.primitives import (
    Primitives,
    extract_primitives,
    primitives_of_features,
)
from lineloom_core.matching.thesis.relations import RelationSet, extract_relations
from lineloom_core.matching.thesis.score import agreement_score
from lineloom_core.scan import Scan

RIVAL_DISTANCE, RIVAL_ANGLE = 0.3, 0.15
"""How far apart [m, rad] two answers are different places."""


@dataclass(frozen=True, eq=False)
class Description:
    """What one scan gives to every match it takes part in.

    G: its relations, k < m. G_any: the same in both orders, what others' relations are looked up
    in. counts: Count(g, G, T) against itself by kind (Algorithm 3).
    """

    primitives: Primitives
    G: RelationSet
    G_any: RelationSet
    counts: tuple[NDArray[np.int64], ...]


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One run of Algorithm 5 and the pose difference it leads to."""

    found: MatchingPairs
    alignment: Alignment

    @property
    def total(self) -> float:
        """Sum of the merged scores of the pairs that agree with the alignment."""
        scores = dict(zip(self.found.pairs, self.found.scores, strict=True))
        return math.fsum(scores[pair] for pair in self.alignment.pairs)


class ThesisMatcher:
    """Matches pairs of scans as the thesis does; holds nothing but its parameters."""

    def __init__(self, config: ThesisConfig | None = None) -> None:
        self.config = config or ThesisConfig()

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "thesis"

    def match(self, reference: Scan, current: Scan) -> MatchResult:
        """Find T_reference_current of two scans without any initial guess."""
        return self.match_prepared(self.prepare(reference), self.prepare(current))

    def prepare(self, scan: Scan) -> Description:
        """Extract primitives (chapter 3) and relations (chapter 4) of one scan."""
        if self.config.lines == "features":
            features = extract_features(scan)
            return self.describe(primitives_of_features(features, self.config.primitives))
        return self.describe(extract_primitives(scan, self.config.primitives))

    def describe(self, primitives: Primitives) -> Description:
        """Extract the relations of given primitives and count them among themselves."""
        windows = self.config.windows
        G = extract_relations(primitives, windows)
        G_any = G
        if self.config.both_orders:
            G_any = extract_relations(primitives, windows, both_orders=True)
        T_cc = consistency_tables(primitives, primitives, windows)
        return Description(
            primitives, G, G_any, count(G, matching_relations(G, G_any, T_cc, windows))
        )

    def match_prepared(self, reference: Description, current: Description) -> MatchResult:
        """Match scans that have been described already (chapter 5)."""
        r, c = reference.primitives, current.primitives
        if len(r.L) < 2 or len(c.L) < 2:
            return _none("fewer than two line segments in a scan")
        T_rc = consistency_tables(r, c, self.config.windows)  # §4.1.3
        table = compute_scores(  # §5.1, §5.2
            current.G, reference.G_any, current.counts, T_rc, self.config.windows
        )
        hypotheses = self._hypotheses(table, r, c)  # §5.3 to §5.7
        if not hypotheses:
            return _none("no pair of line segments that relations of both scans agree on")
        return self._answer(hypotheses, reference, current)

    def _hypotheses(self, table: MatchingTable, r: Primitives, c: Primitives) -> list[Hypothesis]:
        """Algorithm 5 from its first maximum, then from the greatest cells it did not match.

        Departure: the text trusts its first maximum. The further runs (`rivals`) tell whether
        another answer is as good; they replace the first only with `backtrack`.
        """
        hypotheses: list[Hypothesis] = []
        matched: list[Match] = []
        for _ in range(1 + self.config.rivals):
            k, m, maximum = table.find_maximum_score(matched)
            if maximum <= self.config.threshold:
                break
            found = find_matching_line_segments(table, r, c, self.config, first=(k, m))
            matched += found.pairs
            hypotheses.append(Hypothesis(found, align(found.pairs, r.L, c.L, self.config)))  # §5.6
        if self.config.backtrack:
            hypotheses.sort(key=lambda h: -h.total)
        return hypotheses

    def _answer(
        self, hypotheses: list[Hypothesis], reference: Description, current: Description
    ) -> MatchResult:
        best, *others = hypotheses
        rivals = [h for h in others if _is_elsewhere(h, best)]
        lead = 1.0 - max((h.total for h in rivals), default=0.0) / best.total
        score = agreement_score(best.total, best.alignment.translation.edges)
        share = best.total / greatest_total(current)
        verdict, reason = self._verdict(best, lead, score, share)
        pose = best.alignment.T_reference_current
        undetermined = best.alignment.translation.undetermined
        return MatchResult(
            verdict=verdict,
            T_reference_current=None if verdict == "none" else pose,
            weak_direction=undetermined if verdict == "weak" else None,
            covariance=None,
            score=score,
            reason=reason,
            pairs=_line_pairs(best, reference.primitives, current.primitives),
            checks={
                "pairs": float(len(best.alignment.pairs)),
                "total": best.total,
                "share": share,
                "edges": float(best.alignment.translation.edges),
                "discarded": float(len(best.alignment.discarded)),
                "spread": best.alignment.translation.spread,
                "lead": lead,
            },
            alternatives=tuple(
                Alternative(h.alignment.T_reference_current, score * min(h.total / best.total, 1.0))
                for h in rivals
            ),
            best=pose,
        )

    def _verdict(
        self, best: Hypothesis, lead: float, score: float, share: float
    ) -> tuple[Verdict, str]:
        config = self.config
        count_of_pairs = len(best.alignment.pairs)
        if count_of_pairs < 2:
            return "none", "a single pair of line segments is no evidence"
        if best.alignment.translation.spread > config.most_spread:
            spread = best.alignment.translation.spread
            return "none", f"the common edges contradict one another by {spread:.2f} m"
        if best.alignment.translation.undetermined is not None:
            return self._verdict_of_parallels(count_of_pairs, lead, share)
        if count_of_pairs < config.least_pairs or score < config.least_score:
            return "none", f"{count_of_pairs} pairs agree: right with a probability of {score:.2f}"
        if lead < config.least_margin:
            return "ambiguous", "another first maximum leads to an answer as good"
        return "match", "the matching line segments agree"

    def _verdict_of_parallels(
        self, count_of_pairs: int, lead: float, share: float
    ) -> tuple[Verdict, str]:
        """Parallel lines alone are common: there must be several, or little else in the scan."""
        config = self.config
        if count_of_pairs < config.least_pairs and share < config.least_share:
            return "none", f"only {count_of_pairs} parallel pairs agree, {100 * share:.0f} % of all"
        if lead < config.least_margin:
            return "ambiguous", "another first maximum leads to an answer as good"
        return "weak", "all matching line segments are parallel: they may slide along"


def greatest_total(current: Description) -> float:
    """Sum of merged scores if every relation of S_c were found once in S_r.

    A score of 1 / Count(g_c, G_c) for each line of each relation: what the "share" among the
    checks is the share of.
    """
    kinds = zip(current.G.kinds, current.counts, strict=True)
    return math.fsum(
        float(np.sum((relations.lines >= 0).sum(axis=1) / np.maximum(counts, 1)))
        for relations, counts in kinds
    )


def _is_elsewhere(hypothesis: Hypothesis, best: Hypothesis) -> bool:
    a, b = hypothesis.alignment.T_reference_current, best.alignment.T_reference_current
    dx, dy = a.x - b.x, a.y - b.y
    apart = math.hypot(dx, dy)
    if (along := best.alignment.translation.undetermined) is not None:
        apart = abs(dy * math.cos(along) - dx * math.sin(along))
    return apart > RIVAL_DISTANCE or abs(angle_difference(a.theta, b.theta)) > RIVAL_ANGLE


def _line_pairs(best: Hypothesis, r: Primitives, c: Primitives) -> tuple[LinePair, ...]:
    """The matching pairs with how well they lie on each other."""
    moved = c.L.moved(best.alignment.T_reference_current)
    pairs = []
    for k, m in best.alignment.pairs:
        u = np.array([math.cos(r.L.directions[k]), math.sin(r.L.directions[k])])
        n = np.array([-u[1], u[0]])
        s_k, e_k = float(u @ r.L.s[k]), float(u @ r.L.e[k])
        s_m, e_m = float(u @ moved.s[m]), float(u @ moved.e[m])
        distance = abs(float(n @ (0.5 * (moved.s[m] + moved.e[m]) - r.L.s[k])))
        angle = abs(angle_difference(float(moved.directions[m]), float(r.L.directions[k])))
        overlap = max(min(e_k, e_m) - max(s_k, s_m), 0.0)
        pairs.append(LinePair(k, m, overlap, distance, angle))
    return tuple(pairs)


def _none(reason: str) -> MatchResult:
    return MatchResult("none", None, None, None, 0.0, reason)
