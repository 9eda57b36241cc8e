"""Fusion: its laws, its figures, and its slow twin."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lineloom_core.fusion import FusionConfig, LineObservations, fuse
from lineloom_core.fusion.merge import merge_observations
from lineloom_core.geometry import Pose
from numpy.typing import NDArray

Array = NDArray[np.float64]


def observe(
    endpoints: list[tuple[float, float, float, float]] | Array,
    keyframe: list[int] | None = None,
    robot: list[int] | None = None,
) -> LineObservations:
    e = np.asarray(endpoints, dtype=np.float64).reshape(-1, 4)
    n = e.shape[0]
    return LineObservations(
        endpoints=e,
        sigma=np.full(n, 0.01),
        weight=np.ones(n),
        keyframe=np.array(keyframe if keyframe is not None else range(n), dtype=np.int64),
        robot=np.array(robot if robot is not None else [0] * n, dtype=np.int64),
        stamp=np.arange(n, dtype=np.float64),
        id=np.arange(100, 100 + n, dtype=np.int64),
    )


def rooms(count: int, per_wall: int, seed: int) -> LineObservations:
    """Pieces of the walls of rectangular rooms in a row, both faces, noisy."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(count):
        x, w, h = 6.0 * k, 5.7, 4.0 + (k % 3)
        corners = np.array([[x, 0.0], [x + w, 0.0], [x + w, h], [x, h]])
        for i in range(4):
            a, b = corners[i], corners[(i + 1) % 4]
            for _ in range(per_wall):
                t = np.sort(rng.uniform(0.0, 1.0, 2))
                if (t[1] - t[0]) * np.linalg.norm(b - a) > 0.3:
                    ends = a + t[:, None] * (b - a) + rng.normal(0.0, 0.012, (2, 2))
                    rows.append(ends.ravel())
    e = np.array(rows)[rng.permutation(len(rows))]
    n = len(rows)
    return replace(
        observe(e),
        sigma=rng.uniform(0.005, 0.02, n),
        keyframe=rng.integers(0, max(n // 6, 1), n),
        robot=rng.integers(0, 3, n),
        stamp=rng.uniform(0.0, 500.0, n),
    )


def permuted(observations: LineObservations, order: NDArray[np.int64]) -> LineObservations:
    fields = ("endpoints", "sigma", "weight", "keyframe", "robot", "stamp", "id")
    return LineObservations(**{name: getattr(observations, name)[order] for name in fields})


# --- the twin -----------------------------------------------------------------------------------


class SlowLine:
    """A growing wall: all its pieces kept, everything computed anew from them."""

    def __init__(self, ends: Array, weights: Array, mean: Array, scatter: Array) -> None:
        self.ends, self.weight, self.mean, self.scatter = ends, weights, mean, scatter

    @staticmethod
    def of(endpoints: Array, sigma: float, weight: float) -> SlowLine:
        p, q = endpoints[:2], endpoints[2:]
        mass = weight / sigma**2
        return SlowLine(
            np.array([p, q]), np.array(mass), (p + q) / 2, mass * np.outer(q - p, q - p) / 12
        )

    def with_(self, other: SlowLine) -> SlowLine:
        weight = self.weight + other.weight
        mean = (self.weight * self.mean + other.weight * other.mean) / weight
        scatter = np.zeros((2, 2))
        for part in (self, other):
            d = part.mean - mean
            scatter = scatter + part.scatter + part.weight * np.outer(d, d)
        u = np.linalg.eigh(scatter)[1][:, 1]
        if u @ (self.ends[1] - self.ends[0] + other.ends[1] - other.ends[0]) < 0:
            u = -u
        low = min((self.ends[0] - mean) @ u, (other.ends[0] - mean) @ u)
        high = max((self.ends[1] - mean) @ u, (other.ends[1] - mean) @ u)
        return SlowLine(np.array([mean + low * u, mean + high * u]), weight, mean, scatter)

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    @property
    def direction(self) -> Array:
        return np.asarray((self.ends[1] - self.ends[0]) / self.length)

    @property
    def spread(self) -> float:
        return float(math.sqrt(max(np.linalg.eigvalsh(self.scatter)[0], 0.0) / self.weight))


def slow_cost(line: SlowLine, piece: SlowLine, config: FusionConfig) -> float:
    u, v = line.direction, piece.direction
    cosine = float(u @ v)
    if cosine < math.cos(config.max_angle):
        return math.inf
    start, end = ((p - line.ends[0]) @ u for p in piece.ends)
    low, high = max(start, 0.0), min(end, line.length)
    if low - high > config.max_gap:
        return math.inf
    middle = 0.5 * (low + high)
    on_piece = piece.ends[0] + (middle - start) / cosine * v
    on_line = line.ends[0] + middle * u
    offset = float(np.linalg.norm(on_piece - on_line))
    if offset > config.max_offset:
        return math.inf
    return (offset / config.max_offset) ** 2 + (1 - cosine) / (1 - math.cos(config.max_angle))


def slow_merge_pass(
    pieces: list[SlowLine], order: list[int], config: FusionConfig
) -> tuple[list[int], list[SlowLine]]:
    """Every piece against every line, no hash."""
    labels, lines = [-1] * len(pieces), list[SlowLine]()
    for i in order:
        best, best_cost = -1, math.inf
        for k, line in enumerate(lines):
            cost = slow_cost(line, pieces[i], config)
            if cost < best_cost and line.with_(pieces[i]).spread <= config.max_spread:
                best, best_cost = k, cost
        if best < 0:
            labels[i] = len(lines)
            lines.append(pieces[i])
        else:
            labels[i] = best
            lines[best] = lines[best].with_(pieces[i])
    return labels, lines


def slow_labels(o: LineObservations, config: FusionConfig) -> list[int]:
    lines = [SlowLine.of(e, s, w) for e, s, w in zip(o.endpoints, o.sigma, o.weight, strict=True)]
    age, labels = o.id.tolist(), list(range(len(o)))
    while True:
        order = sorted(range(len(lines)), key=lambda i: (-lines[i].length, age[i]))
        step, merged = slow_merge_pass(lines, order, config)
        age = [min(a for a, s in zip(age, step, strict=True) if s == k) for k in range(len(merged))]
        labels = [step[k] for k in labels]
        if len(merged) == len(lines):
            return labels
        lines = merged


@pytest.mark.parametrize("seed", range(12))
def test_merging_agrees_with_its_slow_twin(seed: int) -> None:
    observations = rooms(1 + seed % 3, 4 + seed % 5, seed)
    config = FusionConfig()
    fast, _ = merge_observations(observations, config)
    assert fast.tolist() == slow_labels(observations, config)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_clutter_agrees_with_the_slow_twin(seed: int) -> None:
    """Nothing like walls: dense short and long segments at all angles, where merges are many."""
    rng = np.random.default_rng(seed)
    n = 60
    start, angle = rng.uniform(0.0, 3.0, (n, 2)), rng.choice(8, n) * 0.79 + rng.normal(0, 0.04, n)
    length = rng.exponential(0.8, n) + 0.05
    end = start + length[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    observations = observe(np.hstack([start, end]))
    fast, _ = merge_observations(observations, FusionConfig())
    assert fast.tolist() == slow_labels(observations, FusionConfig())


# --- when two segments are one wall -------------------------------------------------------------


@pytest.mark.parametrize(
    ("second", "lines"),
    [
        ((0.5, 0.05, 2.5, 0.05), 1),  # 5 cm across
        ((0.5, 0.10, 2.5, 0.10), 2),  # 10 cm across
        ((2.10, 0.0, 3.0, 0.0), 1),  # 10 cm gap
        ((2.20, 0.0, 3.0, 0.0), 2),  # 20 cm gap
        ((0.5, -0.04, 1.5, 0.04), 1),  # 4.6 degrees
        ((0.5, -0.06, 1.5, 0.06), 2),  # 6.9 degrees
        ((1.5, 0.02, 0.5, 0.02), 2),  # the other face of a thin wall
    ],
)
def test_the_rules(second: tuple[float, float, float, float], lines: int) -> None:
    fused = fuse(observe([(0.0, 0.0, 2.0, 0.0), second]))
    assert len(fused) == lines
    turned = fuse(observe([second, (0.0, 0.0, 2.0, 0.0)]))
    assert len(turned) == lines


def test_opposite_faces_of_a_thin_wall_stay_apart_however_often_seen() -> None:
    rng = np.random.default_rng(0)
    front = np.tile([0.0, 0.0, 4.0, 0.0], (30, 1)) + rng.normal(0, 0.01, (30, 4))
    back = np.tile([4.0, -0.05, 0.0, -0.05], (30, 1)) + rng.normal(0, 0.01, (30, 4))
    fused = fuse(observe(np.vstack([front, back])))
    assert len(fused) == 2
    assert fused.endpoints[0, 0] < fused.endpoints[0, 2]
    assert fused.endpoints[1, 0] > fused.endpoints[1, 2]


def test_a_bridge_joins_two_walls_that_came_first() -> None:
    fused = fuse(observe([(0.0, 0.0, 2.0, 0.0), (2.5, 0.0, 5.0, 0.0), (1.9, 0.0, 2.6, 0.0)]))
    assert len(fused) == 1
    np.testing.assert_allclose(fused.endpoints, [[0.0, 0.0, 5.0, 0.0]], atol=1e-9)
    assert fused.line_of.tolist() == [0, 0, 0]


def test_chords_of_a_round_wall_do_not_become_one() -> None:
    t = np.radians(np.arange(0, 60, 5.0))
    p = 4.0 * np.column_stack([np.cos(t), np.sin(t)])
    fused = fuse(observe(np.hstack([p[:-1], p[1:]])))
    assert len(fused) >= 4


# --- figures ------------------------------------------------------------------------------------


def test_support_robots_stamps_and_ids_by_hand() -> None:
    observations = observe(
        [
            (0.0, 0.0, 2.0, 0.0),
            (5.0, 5.0, 5.0, 7.0),
            (0.1, 0.01, 2.1, 0.01),
            (0.2, 0.0, 1.8, 0.0),
        ],
        keyframe=[7, 7, 9, 9],
        robot=[2, 2, 0, 0],
    )
    fused = fuse(observations)
    assert fused.support.tolist() == [2, 1]
    assert fused.robots == ((0, 2), (2,))
    assert fused.id.tolist() == [100, 101]
    assert fused.first_seen.tolist() == [0.0, 1.0]
    assert fused.last_seen.tolist() == [3.0, 1.0]
    assert fused.line_of.tolist() == [0, 1, 0, 0]


def test_sigma_shrinks_with_agreement_and_not_with_disagreement() -> None:
    one = fuse(observe([(0.0, 0.0, 2.0, 0.0)]))
    assert one.sigma[0] == pytest.approx(0.01)
    agree = fuse(observe([(0.0, 0.0, 2.0, 0.0)] * 4))
    assert agree.sigma[0] == pytest.approx(0.005)
    apart = fuse(observe([(0.0, y, 2.0, y) for y in (-0.03, 0.03, -0.03, 0.03)]))
    assert apart.sigma[0] == pytest.approx(math.hypot(0.005, 0.03 / 2))
    often = replace(observe([(0.0, 0.0, 2.0, 0.0)]), weight=np.array([4.0]))
    assert fuse(often).sigma[0] == pytest.approx(0.005)


def test_the_line_is_the_weighted_total_least_squares_line() -> None:
    rng = np.random.default_rng(3)
    x = np.sort(rng.uniform(0, 5, (25, 2)), axis=1)
    y = 0.02 * x + rng.normal(0, 0.01, (25, 2))
    observations = observe(np.column_stack([x[:, 0], y[:, 0], x[:, 1], y[:, 1]]))
    fused = fuse(observations, FusionConfig(max_angle=1.0, max_gap=5.0, max_offset=1.0))
    assert len(fused) == 1
    t = np.linspace(0, 1, 2001)  # the same mass as points
    points = x[:, :1] + (x[:, 1:] - x[:, :1]) * t, y[:, :1] + (y[:, 1:] - y[:, :1]) * t
    cloud = np.column_stack([points[0].ravel(), points[1].ravel()])
    u = np.linalg.eigh(np.cov(cloud.T))[1][:, 1]
    e = fused.endpoints[0]
    normal = np.array([-u[1], u[0]])
    for end in (e[:2], e[2:]):
        assert (end - cloud.mean(axis=0)) @ normal == pytest.approx(0.0, abs=1e-4)


def test_one_slight_overshoot_does_not_move_an_end_but_a_long_stretch_does() -> None:
    base = [(0.0, 0.0, 3.0, 0.0)] * 5
    assert fuse(observe([*base, (1.0, 0.0, 3.2, 0.0)])).endpoints[0, 2] == pytest.approx(3.0)
    assert fuse(observe([*base, (1.0, 0.0, 4.2, 0.0)])).endpoints[0, 2] == pytest.approx(4.2)
    assert fuse(observe([*base[:2], (1.0, 0.0, 3.2, 0.0)])).endpoints[0, 2] == pytest.approx(3.2)


def test_short_and_rarely_seen_lines_can_be_dropped() -> None:
    rows = [(0.0, 0.0, 0.1, 0.0), (0.0, 2.0, 0.5, 2.0), (0.0, 4.0, 3.0, 4.0), (0.0, 4.0, 3.0, 4.01)]
    assert fuse(observe(rows)).line_of.tolist() == [-1, 0, 1, 1]
    assert fuse(observe(rows), FusionConfig(min_length_alone=1.0)).line_of.tolist() == [
        -1,
        -1,
        0,
        0,
    ]
    assert fuse(observe(rows), FusionConfig(min_support=2)).line_of.tolist() == [-1, -1, 0, 0]
    assert len(fuse(observe(rows), FusionConfig(min_length=0.0, min_length_alone=0.0))) == 3


# --- laws ---------------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(st.floats(-80, 80), st.floats(-80, 80), st.floats(-3.1, 3.1), st.integers(0, 50))
def test_moving_the_observations_moves_the_lines(
    x: float, y: float, theta: float, seed: int
) -> None:
    observations = rooms(3, 8, seed)
    T = Pose(x, y, theta)
    moved = replace(
        observations,
        endpoints=T.transform(observations.endpoints.reshape(-1, 2)).reshape(-1, 4),
    )
    here, there = fuse(observations), fuse(moved)
    assert there.line_of.tolist() == here.line_of.tolist()
    expected = T.transform(here.endpoints.reshape(-1, 2)).reshape(-1, 4)
    np.testing.assert_allclose(there.endpoints, expected, atol=1e-7)
    np.testing.assert_allclose(there.sigma, here.sigma, atol=1e-9)


def test_the_order_of_observations_does_not_matter_nor_does_repetition() -> None:
    observations = rooms(6, 12, 1)
    first = fuse(observations)
    assert fuse(observations).endpoints.tobytes() == first.endpoints.tobytes()
    order = np.random.default_rng(2).permutation(len(observations))
    other = fuse(permuted(observations, order))
    assert other.endpoints.tobytes() == first.endpoints.tobytes()
    assert other.sigma.tobytes() == first.sigma.tobytes()
    assert other.id.tolist() == first.id.tolist()
    assert other.robots == first.robots
    assert other.line_of.tolist() == first.line_of[order].tolist()


def test_fusing_the_fused_changes_nothing_to_speak_of() -> None:
    first = fuse(rooms(6, 15, 4))
    again = fuse(replace(observe(first.endpoints), sigma=first.sigma, id=first.id))
    assert len(again) == len(first)
    np.testing.assert_allclose(again.endpoints, first.endpoints, atol=1e-9)


def test_support_counts_add_up() -> None:
    observations = rooms(4, 20, 5)
    fused = fuse(observations)
    for line in range(len(fused)):
        inside = fused.line_of == line
        assert fused.support[line] == len(set(observations.keyframe[inside].tolist()))
        assert fused.robots[line] == tuple(sorted(set(observations.robot[inside].tolist())))
        assert fused.id[line] == observations.id[inside].min()


def test_rooms_come_out_as_rooms() -> None:
    """Four walls a room, each within 2 cm of the truth over its length."""
    fused = fuse(rooms(5, 60, 6), FusionConfig(min_support=8))
    assert len(fused) == 20
    assert fused.sigma.max() < 0.01
    vertical = np.abs(fused.endpoints[:, 0] - fused.endpoints[:, 2]) < 0.1
    xs = np.sort(fused.endpoints[vertical, 0])
    truth = np.sort(np.concatenate([6.0 * np.arange(5), 6.0 * np.arange(5) + 5.7]))
    np.testing.assert_allclose(xs, truth, atol=0.02)


def test_nothing_in_nothing_out() -> None:
    fused = fuse(observe([]))
    assert len(fused) == 0
    assert fused.robots == ()
    pointlike = fuse(observe([(1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 2.0, 0.0)]))
    assert pointlike.line_of.tolist() == [-1, 0]


def test_mistakes_are_named() -> None:
    good = observe([(0.0, 0.0, 1.0, 0.0), (0.0, 1.0, 1.0, 1.0)])
    with pytest.raises(ValueError, match="ids"):
        replace(good, id=np.array([3, 3]))
    with pytest.raises(ValueError, match="sigma"):
        replace(good, sigma=np.array([0.0, 1.0]))
    with pytest.raises(ValueError, match="endpoints"):
        replace(good, endpoints=np.full((2, 4), np.nan))
    with pytest.raises(ValueError, match="keyframe"):
        replace(good, keyframe=np.zeros(3, dtype=np.int64))
