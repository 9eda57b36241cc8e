"""Rotations, translations and their ranking: compiled steps against slow, obvious twins."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures
from lineloom_core.features._kernels import LENGTH
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching import _proposal_kernels as fast
from numpy.typing import NDArray

from tests.core.matching import slow_twins as slow

Floats = NDArray[np.float64]
FeaturePair = tuple[ScanFeatures, ScanFeatures, Pose]
CELL, HALF = 0.2, 6.0
SIDE = int(2.0 * HALF / CELL) + 1


def heaviest_pairs(
    ref: ScanFeatures, cur: ScanFeatures, phi: float, most: int = 60
) -> tuple[NDArray[np.int64], int]:
    pairs = np.empty((most, 2), dtype=np.int64)
    count = fast.compatible_pairs(ref.lines, cur.lines, phi, math.radians(6.0), most, pairs)
    return pairs, count


def as_tuples(pairs: NDArray[Any], count: int) -> list[tuple[int, int]]:
    return [(int(row[0]), int(row[1])) for row in pairs[:count]]


def cast_votes(
    ref: ScanFeatures, cur: ScanFeatures, phi: float
) -> tuple[NDArray[np.int32], Floats, int]:
    pairs, count = heaviest_pairs(ref, cur, phi)
    slots = np.zeros((SIDE, SIDE), dtype=np.int32)
    cells = np.empty((SIDE * SIDE, 5))
    used = fast.vote_translations(
        ref.lines, ref.ends, ref.edges, cur.lines, cur.ends, cur.edges,
        phi, pairs, count, CELL, HALF, slots, cells,
    )  # fmt: skip
    return slots, cells, used


def as_grid(cells: Floats) -> Floats:
    grid = np.zeros((3, SIDE, SIDE))
    for x, y, *sums in cells:
        grid[:, int(x), int(y)] = sums
    return grid


@pytest.mark.parametrize("angle", [0.0, 1.0, -math.pi, math.pi, 7.0, -40.0])
def test_wrapping(angle: float) -> None:
    wrapped = fast.wrap_angle(angle)
    assert -math.pi <= wrapped < math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0)


def test_the_histogram_of_rotations(feature_pairs: list[FeaturePair]) -> None:
    for ref, cur, _ in feature_pairs:
        found = fast.rotation_histogram(ref.lines, cur.lines)
        np.testing.assert_allclose(found, slow.histogram(ref.lines, cur.lines), atol=1e-7)
        total = sum(slow.weight(p, q) for p in ref.lines for q in cur.lines)
        assert found.sum() == pytest.approx(total)


def test_the_peaks_of_the_histogram(feature_pairs: list[FeaturePair]) -> None:
    for ref, cur, T in feature_pairs:
        args = (8, 0.25, math.radians(3.0))
        found = fast.rotation_peaks(ref.lines, cur.lines, *args)
        expected = slow.rotations(ref.lines, cur.lines, *args)
        assert len(found) == len(expected)
        np.testing.assert_allclose(wrap_array(found - expected), 0.0, atol=1e-7)
        # What the step is for: the true rotation is among them.
        assert np.abs(wrap_array(found - T.theta)).min() < math.radians(2.0)


@pytest.mark.parametrize("most", [10, 60, 500])
def test_the_heaviest_compatible_pairs(feature_pairs: list[FeaturePair], most: int) -> None:
    for ref, cur, T in feature_pairs:
        pairs, count = heaviest_pairs(ref, cur, T.theta, most)
        weights = slow.compatible(ref.lines, cur.lines, T.theta, math.radians(6.0))
        assert len(weights) > 10
        assert count == min(most, len(weights))
        chosen = as_tuples(pairs, count)
        assert len(set(chosen)) == count
        # Of pairs that weigh the same any may be left out.
        heaviest = sorted(weights.values(), reverse=True)[:most]
        found = sorted((weights[pair] for pair in chosen), reverse=True)
        np.testing.assert_allclose(found, heaviest)


def test_overlap_of_segments() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        a, b, c, d = rng.uniform(-3.0, 3.0, (4, 2))
        line = np.zeros(12)
        line[:2], line[2:4] = a, b
        line[LENGTH] = slow.length(line)
        u = slow.direction(line)
        assert fast.overlap_length(line, *u, *c, *d) == pytest.approx(slow.overlap(line, c, d))


def test_votes_for_translations(feature_pairs: list[FeaturePair]) -> None:
    for ref, cur, T in feature_pairs:
        pairs, count = heaviest_pairs(ref, cur, T.theta)
        slots, cells, used = cast_votes(ref, cur, T.theta)
        votes = slow.votes(ref, cur, T.theta, as_tuples(pairs, count))
        expected, order = slow.vote_grid(votes, CELL, HALF, SIDE)
        assert np.count_nonzero(expected[0]) >= 2
        np.testing.assert_allclose(as_grid(cells[:used]), expected, atol=1e-7)
        assert as_tuples(cells, used) == order
        assert [int(slots[at]) for at in order] == list(range(1, used + 1))


def test_the_best_cells_and_the_grid_left_empty(feature_pairs: list[FeaturePair]) -> None:
    for ref, cur, T in feature_pairs:
        slots, cells, used = cast_votes(ref, cur, T.theta)
        expected = slow.best_cells(as_grid(cells[:used]), as_tuples(cells, used), 12)
        out = np.empty((12, 3))
        count = fast.vote_peaks(slots, cells, used, 12, out)
        np.testing.assert_allclose(out[:count], expected, atol=1e-7)
        assert not slots.any()
        assert np.hypot(*(out[:count, :2] - [T.x, T.y]).T).min() < 0.15


def test_explained_length(feature_pairs: list[FeaturePair]) -> None:
    rng = np.random.default_rng(1)
    for ref, cur, T in feature_pairs:
        pairs, count = heaviest_pairs(ref, cur, T.theta)
        taken = np.empty(len(cur))
        for shift in (0.0, 0.1, 1.0):
            x, y = np.array([T.x, T.y]) + rng.uniform(-shift, shift, 2)
            found = fast.explained_length(
                ref.lines, cur.lines, T.theta, pairs, count, x, y, 0.25, taken
            )
            pose = Pose(float(x), float(y), T.theta)
            expected = slow.explained(ref.lines, cur.lines, pose, as_tuples(pairs, count), 0.25)
            assert found == pytest.approx(expected, abs=1e-8)
        assert expected >= 0.0


def test_proposals_are_the_steps_one_after_the_other(feature_pairs: list[FeaturePair]) -> None:
    for ref, cur, T in feature_pairs[:2]:
        table = fast.propose(
            ref.lines, ref.ends, ref.edges, cur.lines, cur.ends, cur.edges,
            4, 3, 0.25, 60, CELL, HALF, 0.25,
        )  # fmt: skip
        rows = []
        for phi in fast.rotation_peaks(ref.lines, cur.lines, 4, 0.25, math.radians(3.0)):
            pairs, count = heaviest_pairs(ref, cur, phi)
            chosen = as_tuples(pairs, count)
            cells = slow.best_cells(
                *slow.vote_grid(slow.votes(ref, cur, phi, chosen), CELL, HALF, SIDE), 3
            )
            for x, y, votes in cells:
                length = slow.explained(ref.lines, cur.lines, Pose(x, y, phi), chosen, 0.25)
                rows.append((x, y, phi, length, votes))
        assert len(rows) >= 3
        expected = np.array(sorted(rows, key=lambda row: -row[3]))
        np.testing.assert_allclose(table, expected, atol=1e-6)
        # The truth is proposed, near the top.
        apart = np.hypot(table[:3, 0] - T.x, table[:3, 1] - T.y)
        assert apart.min() < 0.2


def test_lines_that_lie_on_each_other(feature_pairs: list[FeaturePair]) -> None:
    for ref, cur, T in feature_pairs:
        args = (math.radians(5.0), 0.12, 0.1)
        found = fast.lying_pairs(ref.lines, cur.lines, T.to_array(), *args)
        expected = slow.lying(ref.lines, cur.lines, T, *args)
        assert len(expected) > 2
        np.testing.assert_allclose(found, expected, atol=1e-8)
