"""The kernels that string the steps together, and bands: against the steps done one by one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures, extract_features
from lineloom_core.features._kernels import THETA
from lineloom_core.geometry import Pose, wrap
from lineloom_core.matching import _band_kernels, _kernels, _proposal_kernels, _refinement_kernels
from lineloom_core.matching.free_space import TOLERANCE, TOLERANCE_SLOPE
from lineloom_core.simulation import World, sick_lms200
from numpy.typing import NDArray

from tests.core.matching import slow_twins as slow

Floats = NDArray[np.float64]
FeaturePair = tuple[ScanFeatures, ScanFeatures, Pose]
TOLERANCES = (TOLERANCE, TOLERANCE_SLOPE)
PROPOSING = (8, 12, 0.25, 120, 0.05, 5.0, 0.25)  # cells so small that some end up as twins

# Compiled functions carry no types.
match_sweeps: Any = _kernels.match_sweeps
match_bands: Any = _band_kernels.match_bands
propose_bands: Any = _band_kernels.propose_bands
slide_band: Any = _band_kernels.slide_band
propose: Any = _proposal_kernels.propose
refine: Any = _refinement_kernels.refine


def lines_of(f: ScanFeatures) -> tuple[Any, ...]:
    return f.lines, f.ends, f.edges


def sweep_of(f: ScanFeatures) -> slow.Sweep:
    return f.ranges, f.angle_min, f.angle_increment


def judged(
    ref: ScanFeatures, cur: ScanFeatures, pose: Floats, step: int, tolerances: tuple[float, float]
) -> Floats:
    """Metres of wall, both ways, every step-th point standing for all."""
    T = Pose.from_array(pose)
    spacings = cur.angle_increment, ref.angle_increment
    there = slow.judge_all(cur.points[::step], spacings[0], T, sweep_of(ref), *tolerances)
    back = slow.judge_all(ref.points[::step], spacings[1], T.inverse(), sweep_of(cur), *tolerances)
    return step * (there + back)


def evidence(row: Floats) -> float:
    """Overlap and matched wall, less thrice what contradicts."""
    return float(row[9] + row[5] - 3.0 * row[6])


def refined(ref: ScanFeatures, cur: ScanFeatures, proposal: Floats, step: int) -> Floats:
    """One hypothesis refined and judged, as a row of 16."""
    pose, H = proposal[:3].copy(), np.empty((3, 3))
    overlap = refine(*lines_of(ref), *lines_of(cur), pose, H, 4)
    counts = judged(ref, cur, pose, step, TOLERANCES)
    return np.array([*pose, *proposal[3:5], *counts, overlap, *H[np.triu_indices(3)]])


def slow_match(
    ref: ScanFeatures, cur: ScanFeatures, coarse: int, fine: int, apart: float = 0.08
) -> Floats:
    proposals = propose(*lines_of(ref), *lines_of(cur), *PROPOSING)[:coarse]
    # The cascade: six always, then only what explains at least half of what the best explains.
    proposals = [r for k, r in enumerate(proposals) if k < 6 or r[3] >= 0.5 * proposals[0][3]]
    wide = (TOLERANCE + 0.15, TOLERANCE_SLOPE + 0.01)
    ranks = []
    for row in proposals:
        counts = judged(ref, cur, row[:3], 6, wide)
        ranks.append(row[3] + counts[0] - 2.0 * counts[1])
    rows: list[Floats] = []
    order = sorted(range(len(ranks)), key=lambda k: -ranks[k])[:fine]
    for q, k in enumerate(order):
        if q >= 3 and ranks[k] < 0.5 * ranks[order[0]]:
            break
        row = refined(ref, cur, proposals[k], 2)
        near = [r for r in rows if math.dist(r[:2], row[:2]) < apart]
        if row[9] > 0.0 and all(abs(wrap(r[2] - row[2])) >= 0.03 for r in near):
            rows.append(row)
    return np.array(sorted(rows, key=lambda row: -evidence(row)))


def assert_same_hypotheses(found: Floats, expected: Floats) -> None:
    assert found.shape == expected.shape
    np.testing.assert_allclose(found[:, :5], expected[:, :5], atol=1e-9)
    # A point at the border of two beams may fall either way: its wall, times the step.
    np.testing.assert_allclose(found[:, 5:9], expected[:, 5:9], atol=0.21)
    np.testing.assert_allclose(found[:, 9:16], expected[:, 9:16], rtol=1e-9, atol=1e-6)


def test_a_match_is_its_steps_one_after_the_other(feature_pairs: list[FeaturePair]) -> None:
    twins = 0
    for ref, cur, T in feature_pairs[:3]:
        found = match_sweeps(
            *lines_of(ref), ref.points, *sweep_of(ref), *lines_of(cur), cur.points,
            *sweep_of(cur), *PROPOSING, 40, 40, 4, *TOLERANCES,
        )  # fmt: skip
        assert_same_hypotheses(found, slow_match(ref, cur, 40, 40))
        assert Pose.from_array(found[0, :3]).distance(T) < 0.05
        twins += len(slow_match(ref, cur, 40, 40, apart=0.0)) - len(found)
    assert twins > 0


@pytest.fixture(scope="module")
def corridor() -> FeaturePair:
    """Two looks into a corridor of 2.4 m with one cabinet, in opposite directions."""
    walls = [[-60, 0, 60, 0], [60, 2.4, -60, 2.4], [1, 2.4, 1, 2], [1, 2, 2, 2], [2, 2, 2, 2.4]]
    world, rng = World(np.array(walls, dtype=float)), np.random.default_rng(0)
    a, b = Pose(0.0, 1.1, 0.2), Pose(3.1, 1.3, math.pi - 0.1)
    ref, cur = (extract_features(sick_lms200().scan(world, p, rng)) for p in (a, b))
    return ref, cur, a.between(b)


Constraint = tuple[float, float, bool]
"""Offset across, weight, and which way the wall faces."""


def constraints(ref: Floats, cur: Floats, phi: float) -> tuple[float, list[Constraint]]:
    """The axis, the heaviest pair's, and what every pair along it says of the offset across."""
    pairs = slow.compatible(ref, cur, phi, math.radians(5.0))
    axis = float(ref[max(pairs, key=lambda p: pairs[p])[0], THETA])
    across, said = np.array([-math.sin(axis), math.cos(axis)]), []
    for i, j in pairs:
        turn = wrap(slow.angle_of(ref[i]) - axis)
        alike = abs(turn) <= 0.5 * math.pi
        if abs(turn if alike else wrap(turn + math.pi)) <= math.radians(5.0):
            middles = ref[i, :4].reshape(2, 2).mean(axis=0), cur[j, :4].reshape(2, 2).mean(axis=0)
            moved = Pose(0.0, 0.0, phi).transform(middles[1])
            said.append((float(across @ (middles[0] - moved)), slow.weight(ref[i], cur[j]), alike))
    return axis, said


def support(at: float, alike: bool, said: list[Constraint], window: float) -> float:
    """Weight that agrees with an offset; a corridor's other side counts twice."""
    sides = {True: 0.0, False: 0.0}
    for value, weight, facing in said:
        if abs(value - at) < window:
            sides[facing == alike] += weight * (1.0 - 0.5 * abs(value - at) / window)
    return sides[True] + sides[False] + min(sides.values())


def slow_bands(ref: Floats, cur: Floats, most: int, each: int, window: float) -> Floats:
    rows = []
    for phi in _proposal_kernels.rotation_peaks(ref, cur, most, 0.25, math.radians(3.0)):
        axis, said = constraints(ref, cur, phi)
        left = list(said)
        for _ in range(each):
            if not left:
                break
            best = max(left, key=lambda c: support(c[0], c[2], said, window))
            near = [c for c in said if abs(c[0] - best[0]) < window]
            weights = [sum(w for _, w, f in near if f == side) for side in (True, False)]
            offset = float(np.average([v for v, _, _ in near], weights=[w for _, w, _ in near]))
            total = support(best[0], best[2], said, window)
            rows.append((phi, axis, offset, total, float(min(weights) > 0.3)))
            left = [c for c in left if abs(c[0] - best[0]) >= 1.5 * window]
    return np.array(sorted(rows, key=lambda row: -row[3]))


def test_bands(feature_pairs: list[FeaturePair], corridor: FeaturePair) -> None:
    both = set()
    for ref, cur, _ in (*feature_pairs[:3], corridor):
        found = propose_bands(ref.lines, cur.lines, 8, 3, 0.15)
        np.testing.assert_allclose(found, slow_bands(ref.lines, cur.lines, 8, 3, 0.15), atol=1e-7)
        both |= set(found[:, 4].tolist())
    assert both == {0.0, 1.0}


def slow_slide(ref: ScanFeatures, cur: ScanFeatures, band: Floats) -> tuple[Floats, float]:
    phi, axis, across = band[:3]
    best, winner = -math.inf, np.zeros(3)
    for k in range(-20, 21):
        x, y = Pose(0.0, 0.0, axis).transform([[0.3 * k, across]])[0]
        pose = np.array([x, y, phi])
        counts = judged(ref, cur, pose, 10, (TOLERANCE + 0.05, TOLERANCE_SLOPE))
        if counts[0] - 3.0 * counts[1] > best:
            best, winner = counts[0] - 3.0 * counts[1], pose
    return winner, best


def test_the_slide_that_free_space_likes_best(corridor: FeaturePair) -> None:
    ref, cur, _ = corridor
    for band in propose_bands(ref.lines, cur.lines, 8, 3, 0.15)[:4]:
        found = slide_band(
            ref.points, *sweep_of(ref), cur.points, *sweep_of(cur), *band[:3], 6.01, 0.3,
            *TOLERANCES,
        )  # fmt: skip
        pose, value = slow_slide(ref, cur, band)
        np.testing.assert_allclose(found, [*pose, value], atol=1e-9)


def test_matching_bands_is_its_steps_one_after_the_other(corridor: FeaturePair) -> None:
    ref, cur, _ = corridor
    found = match_bands(
        *lines_of(ref), ref.points, *sweep_of(ref), *lines_of(cur), cur.points, *sweep_of(cur),
        8, 3, 0.15, 4, 6.01, 0.3, 4, *TOLERANCES,
    )  # fmt: skip
    rows = []
    for band in slow_bands(ref.lines, cur.lines, 8, 3, 0.15)[:4]:
        pose, _ = slow_slide(ref, cur, band)
        row = refined(ref, cur, np.array([*pose, band[3], band[3]]), 1)
        rows.append([*row, band[1], band[3], band[4]])
    expected = np.array(sorted(rows, key=lambda row: -evidence(np.array(row))))
    assert_same_hypotheses(found, expected)
    np.testing.assert_allclose(found[:, 16:], expected[:, 16:], atol=1e-7)
