"""The kernels that string the steps together, and bands: against the steps done one by one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures, extract_features
from lineloom_core.features._kernels import THETA
from lineloom_core.geometry import Pose, wrap
from lineloom_core.matching import (
    _agreement_kernels,
    _band_kernels,
    _free_space_kernels,
    _hypothesis,
    _kernels,
    _proposal_kernels,
    _refinement_kernels,
)
from lineloom_core.matching._sweep import Search, Sweep
from lineloom_core.matching.matcher import MatcherConfig
from lineloom_lab.simulation import World, rectangle, sick_lms200
from numpy.typing import NDArray

from tests.core.matching import slow_twins as slow

Floats = NDArray[np.float64]
FeaturePair = tuple[ScanFeatures, ScanFeatures, Pose]
SEARCH = MatcherConfig().search()
WIDE = SEARCH._replace(cell=0.05, half=5.0, coarse_keep=40, fine_keep=40)
"""Cells so small that some hypotheses end up as twins."""
FINE = (_kernels.FINE_BASE, _kernels.FINE_SLOPE)
CONFLICT, MATCHED = _free_space_kernels.CONFLICT, _free_space_kernels.MATCHED

# Compiled functions carry no types.
match_sweeps: Any = _kernels.match_sweeps
propose_bands: Any = _band_kernels.propose_bands
propose_slides: Any = _band_kernels.propose_slides
slide_profile: Any = _band_kernels.slide_profile
propose: Any = _proposal_kernels.propose
refine_all: Any = _refinement_kernels.refine_all
thin_points: Any = _free_space_kernels.thin_points


def sweep_of(f: ScanFeatures) -> slow.Sweep:
    return f.ranges, f.angle_min, f.angle_increment


def judged(ref: ScanFeatures, cur: ScanFeatures, pose: Floats) -> Floats:
    """Metres of wall, both ways, every second point standing for two."""
    T, step = Pose.from_array(pose), _kernels.FINE_STEP
    spacings = cur.angle_increment, ref.angle_increment
    there = slow.judge_all(cur.points[::step], spacings[0], T, sweep_of(ref), *FINE)
    back = slow.judge_all(ref.points[::step], spacings[1], T.inverse(), sweep_of(cur), *FINE)
    return step * (there + back)


def slow_thin(f: ScanFeatures, stride: float) -> Floats:
    """The points at which the wall passed so far goes beyond a multiple of the stride."""
    wall = [min(math.hypot(*p) * f.angle_increment, 0.05) for p in f.points]
    passed = (np.cumsum(wall) / stride + 0.5).astype(int)
    return f.points[np.diff(passed, prepend=0) > 0]


def judged_thinned(
    ref: ScanFeatures, cur: ScanFeatures, pose: Floats, stride: float, base: float, slope: float
) -> Floats:
    """Numbers of thinned points by verdict, both ways."""
    T, counts = Pose.from_array(pose), np.zeros(4)
    for p in slow_thin(cur, stride):
        counts[slow.judge(T.transform(p), *sweep_of(ref), base, slope)] += 1
    for p in slow_thin(ref, stride):
        counts[slow.judge(T.inverse().transform(p), *sweep_of(cur), base, slope)] += 1
    return counts


def evidence(row: Floats) -> float:
    return float(row[5] + 0.25 * row[9] - 2.5 * row[6])


def is_twin(row: Floats, rows: list[Floats], apart: float) -> bool:
    near = [r for r in rows if math.dist(r[:2], row[:2]) < apart]
    return any(abs(wrap(r[2] - row[2])) < 0.03 for r in near)


def slid(ref: ScanFeatures, cur: ScanFeatures, pose: Floats, H: Floats, hopeless: float) -> Floats:
    """Along the direction that lines fix least, where they fix it little: the best of nine.

    Nothing is slid that matches less than `hopeless` metres.
    """
    schur = H[:2, :2] - np.outer(H[:2, 2], H[:2, 2]) / H[2, 2]
    values, vectors = np.linalg.eigh(schur)
    if values[0] >= _kernels.SETTLED_ABOVE:
        return pose
    here = judged_thinned(ref, cur, pose, _kernels.SLIDE_STRIDE, *FINE)
    if _kernels.SLIDE_STRIDE * here[MATCHED] < hopeless:
        return pose
    u = vectors[:, 0] * (1.0 if vectors[1, 0] >= 0.0 else -1.0)
    found = []
    for k in range(-4, 5):
        moved = np.array([*(pose[:2] + 0.1 * k * u), pose[2]])
        counts = judged_thinned(ref, cur, moved, _kernels.SLIDE_STRIDE, *FINE)
        value = _kernels.SLIDE_STRIDE * (counts[MATCHED] - 3.0 * counts[CONFLICT])
        found.append((value - 0.15 * abs(k) / 4.0, moved))
    return max(found, key=lambda pair: pair[0])[1]


def settled(
    ref: ScanFeatures, cur: ScanFeatures, proposal: Floats, iterations: int, rows: list[Floats]
) -> Floats:
    """One hypothesis refined, slid and judged, as a row; `rows` are settled already."""
    pose, H = proposal[:3].copy(), np.empty((3, 3))
    r, c = Sweep.of(ref), Sweep.of(cur)
    overlap = refine_all(
        r.lines, r.ends, r.edges, r.circles, c.lines, c.ends, c.edges, c.circles,
        pose, H, iterations,
    )  # fmt: skip
    hopeless = _kernels.HOPELESS * max((r[5] for r in rows), default=0.0)
    pose = slid(ref, cur, pose, H, hopeless) if overlap > 0.0 else pose
    counts = judged(ref, cur, pose)
    return np.array([*pose, *proposal[3:5], *counts, overlap, *H[np.triu_indices(3)]])


def slow_votes(
    ref: ScanFeatures, cur: ScanFeatures, search: Search, apart: float = 0.08
) -> list[Floats]:
    """What the votes of lines come to, in the order they are looked at."""
    lines = (ref.lines, ref.ends, ref.edges, cur.lines, cur.ends, cur.edges)
    proposals = propose(*lines, *search[:7])[: search.coarse_keep]
    # The cascade: six always, then only what explains at least half of what the best explains.
    proposals = [r for k, r in enumerate(proposals) if k < 6 or r[3] >= 0.5 * proposals[0][3]]
    ranks = []
    for row in proposals:
        wide = (_kernels.COARSE_BASE, _kernels.COARSE_SLOPE)
        counts = judged_thinned(ref, cur, row[:3], _kernels.COARSE_STRIDE, *wide)
        gain = counts[MATCHED] - 2.0 * counts[CONFLICT]
        ranks.append(row[3] + _kernels.COARSE_STRIDE * gain)
    rows: list[Floats] = []
    order = sorted(range(len(ranks)), key=lambda k: -ranks[k])[: search.fine_keep]
    worth = _kernels.WORTH_A_LOOK
    for q, k in enumerate(order):
        if q == 3:
            rows.sort(key=lambda row: -evidence(row))
            if _kernels.is_safe(figures_of(ref, cur, rows)):
                worth = _kernels.WORTH_WHEN_SAFE
        if q >= 3 and ranks[k] < worth * ranks[order[0]]:
            break
        row = settled(ref, cur, proposals[k], search.iterations, rows)
        if row[9] > 0.0 and not is_twin(row, rows, apart):
            rows.append(row)
    return sorted(rows, key=lambda row: -evidence(row))


def figures_of(ref: ScanFeatures, cur: ScanFeatures, rows: list[Floats]) -> Floats:
    """The kernel's figures of the first row; `test_figures` holds them to a slow twin."""
    figures = np.zeros(_agreement_kernels.FIGURES)
    table = np.array(rows).reshape(-1, _hypothesis.COLUMNS)
    _agreement_kernels.compare_with_rivals(Sweep.of(ref), Sweep.of(cur), table, len(rows), figures)
    return figures


def slow_match(ref: ScanFeatures, cur: ScanFeatures, search: Search) -> Floats:
    rows = slow_votes(ref, cur, search)
    figures = figures_of(ref, cur, rows)
    if not _kernels.is_safe(figures):
        table = np.array(rows).reshape(-1, _hypothesis.COLUMNS)
        slides = propose_slides(
            Sweep.of(ref), Sweep.of(cur), table, len(rows), figures, search.rotations,
            _kernels.MOST_SLIDES,
        )  # fmt: skip
        for proposal in slides:
            row = settled(ref, cur, proposal, search.iterations, rows)
            if row[9] > 0.0 and not is_twin(row, rows, 0.08):
                rows.append(row)
        rows = sorted(rows, key=lambda row: -evidence(row))
    return np.array(rows)


def assert_same_hypotheses(found: Floats, expected: Floats) -> None:
    assert found.shape == expected.shape
    np.testing.assert_allclose(found[:, :5], expected[:, :5], atol=1e-9)
    # A point at the border of two beams may fall either way: its wall, times the step.
    np.testing.assert_allclose(found[:, 5:9], expected[:, 5:9], atol=0.21)
    np.testing.assert_allclose(found[:, 9:16], expected[:, 9:16], rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("stride", [0.1, 0.25])
def test_thinned_points(feature_pairs: list[FeaturePair], stride: float) -> None:
    for ref, _, _ in feature_pairs:
        found = thin_points(ref.points, ref.angle_increment, stride)
        expected = slow_thin(ref, stride)
        assert abs(len(found) - len(expected)) <= 1
        common = sum(p in expected.tolist() for p in found.tolist())
        assert common >= 0.95 * len(expected)  # sums of many small numbers round differently


def test_a_match_is_its_steps_one_after_the_other(
    feature_pairs: list[FeaturePair], corridor: FeaturePair
) -> None:
    twins, safe = 0, set()
    for (ref, cur, T), search in [(p, WIDE) for p in feature_pairs[:2]] + [(corridor, SEARCH)]:
        found, figures = match_sweeps(Sweep.of(ref), Sweep.of(cur), search)
        assert_same_hypotheses(found, slow_match(ref, cur, search))
        np.testing.assert_allclose(figures, figures_of(ref, cur, list(found)), rtol=1e-9)
        if search is WIDE:
            assert Pose.from_array(found[0, :3]).distance(T) < 0.05
            apart = slow_votes(ref, cur, search, apart=0.0)
            twins += len(apart) - len(slow_votes(ref, cur, search))
        safe.add(bool(_kernels.is_safe(figures)))
    assert twins > 0
    assert safe == {True, False}


def slow_figures(ref: ScanFeatures, cur: ScanFeatures, rows: Floats) -> dict[str, float]:
    """What the first row rests on and how its rivals do, without kernels."""
    best = rows[0]
    pose = Pose.from_array(best[:3])
    pairs = slow.lying(ref.lines, cur.lines, pose, math.radians(5.0), 0.12, 0.1)
    normals = [slow.normal(ref.lines[int(p[0])]) for p in pairs]
    tensor = sum(p[2] * np.outer(n, n) for p, n in zip(pairs, normals, strict=True))
    values, vectors = np.linalg.eigh(np.asarray(tensor))
    u = vectors[:, 0]  # along the walls: the direction that fewest fix
    along = [float(slow.direction(ref.lines[int(p[0])]) @ u) for p in pairs]
    sides = [sum(p[2] for p, a in zip(pairs, along, strict=True) if s * a > 0.95) for s in (1, -1)]
    rivals: dict[str, list[float]] = {"other": [0.0], "slide": [0.0], "unrefuted": [0.0]}
    for row in rows[1:]:
        turned, gap = abs(wrap(row[2] - best[2])), row[:2] - best[:2]
        far = math.hypot(*gap)
        if far <= 0.3 and turned <= 0.15:
            continue
        across = abs(u[0] * gap[1] - u[1] * gap[0])
        if turned < 0.07 and across <= 0.25 + 0.02 * far:
            rivals["slide"].append(evidence(row))
            continue
        rivals["other"].append(evidence(row))
        if row[6] <= best[6] + 0.1:
            rivals["unrefuted"].append(evidence(row))
    walls = min(len({p[0] for p in pairs}), len({p[1] for p in pairs}))
    return {
        "walls": walls, "lean": float(values[0]), "broad": float(values[1]),
        "facing": min(sides), **{name: max(found) for name, found in rivals.items()},
    }  # fmt: skip


def half_rooms() -> FeaturePair:
    """Two looks into a square room: every quarter turn fits."""
    rng, (a, b) = np.random.default_rng(0), (Pose(2.4, 2.7, 0.3), Pose(3.3, 3.0, 1.4))
    ref, cur = (extract_features(sick_lms200().scan(rectangle(6.0, 6.0), p, rng)) for p in (a, b))
    return ref, cur, a.between(b)


def test_figures(feature_pairs: list[FeaturePair], corridor: FeaturePair) -> None:
    seen: dict[str, float] = {}
    for ref, cur, _ in (*feature_pairs[:3], corridor, half_rooms()):
        table, figures = match_sweeps(Sweep.of(ref), Sweep.of(cur), SEARCH)
        expected = slow_figures(ref, cur, table)
        for name, value in expected.items():
            at = int(getattr(_agreement_kernels, name.upper()))
            assert figures[at] == pytest.approx(value, abs=1e-6), name
            seen[name] = max(seen.get(name, 0.0), value)
    assert [name for name, value in seen.items() if value <= 0.0] == []


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


def slow_profile(ref: ScanFeatures, cur: ScanFeatures, band: Floats) -> Floats:
    """What every slide along a band matches, less twice what it contradicts."""
    stride, values = _band_kernels.SLIDE_STRIDE, []
    for k in range(-20, 21):
        x, y = Pose(0.0, 0.0, band[1]).transform([[0.25 * k, band[2]]])[0]
        pose = np.array([x, y, band[0]])
        loose = (_band_kernels.SLIDE_BASE, _band_kernels.SLIDE_SLOPE)
        counts = judged_thinned(ref, cur, pose, stride, *loose)
        values.append(stride * (counts[MATCHED] - 2.0 * counts[CONFLICT]))
    return np.array(values)


def test_the_profile_of_slides_along_a_band(corridor: FeaturePair) -> None:
    ref, cur, _ = corridor
    thin = [
        thin_points(f.points, f.angle_increment, _band_kernels.SLIDE_STRIDE) for f in (ref, cur)
    ]
    for band in propose_bands(ref.lines, cur.lines, 8, 3, 0.15)[:4]:
        found = np.empty(41)
        slide_profile(Sweep.of(ref), Sweep.of(cur), *thin, band, found)
        expected = slow_profile(ref, cur, band)
        # A point at the border of two beams may fall either way.
        np.testing.assert_allclose(found, expected, atol=2.1 * _band_kernels.SLIDE_STRIDE)
        assert np.mean(np.abs(found - expected) < 1e-9) > 0.8


def test_the_likeliest_slides_of_all_bands(corridor: FeaturePair) -> None:
    """At most three a band, half a metre from each other, none far behind the best."""
    ref, cur, T = corridor
    none = np.empty((0, _hypothesis.COLUMNS))
    found = propose_slides(
        Sweep.of(ref), Sweep.of(cur), none, 0, np.zeros(_agreement_kernels.FIGURES), 8, 8
    )
    bands = propose_bands(ref.lines, cur.lines, 8, 3, 0.15)[: _band_kernels.TRIED]
    profiles = [slow_profile(ref, cur, band) for band in bands]
    best = max(float(p.max()) for p in profiles)
    assert 3 <= len(found) <= 8
    for row in found:
        axis = next(b for b in bands if b[0] == row[2] and b[3] == row[3])
        x, y = Pose(0.0, 0.0, axis[1]).inverse().transform(row[None, :2])[0]
        k = round(x / 0.25)
        assert (x, y) == pytest.approx((0.25 * k, axis[2]))
        value = slow_profile(ref, cur, axis)[k + 20]
        assert value >= 0.6 * best - 2.1 * _band_kernels.SLIDE_STRIDE
    for k, row in enumerate(found):
        same = [r for q, r in enumerate(found) if q != k and tuple(r[2:4]) == tuple(row[2:4])]
        assert len(same) <= 2
        assert all(math.dist(r[:2], row[:2]) > 0.45 for r in same)
    # What the step is for: the rotation and the position across are among them.
    axis = float(bands[0][1])
    across = np.array([-math.sin(axis), math.cos(axis)])
    assert any(
        abs(wrap(r[2] - T.theta)) < 0.03 and abs(across @ (r[:2] - [T.x, T.y])) < 0.15
        for r in found
    )
