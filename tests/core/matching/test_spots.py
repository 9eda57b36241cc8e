"""Where seeds settle on a local map and what speaks against that: slow twins, laws."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures, extract_features
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.matching import _spot_kernels as fast
from lineloom_core.matching._free_space_kernels import CONFLICT, MATCHED, judge_points
from lineloom_core.matching._registration_kernels import register
from lineloom_core.matching._sweep import Sweep
from lineloom_core.matching.free_space import TOLERANCE, TOLERANCE_SLOPE
from lineloom_core.matching.local_map import Cloud, LocalMap
from lineloom_core.matching.spots import Latest, Spotter
from lineloom_lab.simulation import Lidar, World, scanner_360, sick_lms200, world_named
from numpy.typing import NDArray

Floats = NDArray[np.float64]
AT = [Pose(2.6, 2.2, 0.2), Pose(2.0, 2.2, 0.0), Pose(1.5, 2.0, -0.2)]
"""Where the latest scans were taken, the latest first."""
TRUE = Pose(3.2, 2.4, 0.5)
SEEDS = [TRUE, TRUE @ Pose(0.1, -0.1, 0.05), TRUE @ Pose(0.02, 0.0, 0.0), AT[0], Pose(4, 3, 2.0)]


@dataclass(frozen=True)
class Seen:
    """Scans of one world: the latest at AT, and one at TRUE."""

    latest: list[tuple[ScanFeatures, Pose]]
    scan: ScanFeatures

    def spotter(self, most_back: int = 2) -> Spotter:
        built = LocalMap.build((Cloud.of(f), p) for f, p in self.latest)
        latest, cloud = Latest.of(self.latest), Cloud.of(self.scan)
        return Spotter(built, latest, Sweep.of(self.scan), cloud, most_back)


def seen(world: World, lidar: Lidar, at: list[Pose] = AT, true: Pose = TRUE) -> Seen:
    rng = np.random.default_rng(2)
    latest = [(extract_features(lidar.scan(world, p, rng)), p) for p in at]
    return Seen(latest, extract_features(lidar.scan(world, true, rng)))


@pytest.fixture(scope="module", params=[sick_lms200(), scanner_360()], ids=["sick", "360"])
def furnished(request: pytest.FixtureRequest) -> Seen:
    return seen(world_named("rooms", 3), request.param)


def slow_judged(
    mover: ScanFeatures, moved_by: Pose, held_against: ScanFeatures, counts: Floats
) -> None:
    judge_points(
        mover.points, mover.angle_increment, 1, moved_by.to_array(), held_against.ranges,
        held_against.angle_min, held_against.angle_increment, TOLERANCE, TOLERANCE_SLOPE, counts,
    )  # fmt: skip


def slow_share(counts: Floats) -> float:
    if not counts.sum():
        return 0.0
    judged = max(counts[MATCHED] + counts[CONFLICT], fast.LEAST_JUDGED * counts.sum())
    return float(counts[CONFLICT] / judged)


def slow_misfit(seen: Seen, pose: Pose, most_back: int, matched: float) -> float:
    """Weighted sum of what lies on nothing, in their free space, and of theirs in the scan's."""
    forth, back = np.zeros(4), np.zeros(4)
    for other, at in seen.latest:
        slow_judged(seen.scan, at.between(pose), other, forth)
    for other, at in seen.latest[:most_back]:
        slow_judged(other, pose.between(at), seen.scan, back)
    against = fast.UNMATCHED * (1.0 - matched), fast.STANDS_FREE * slow_share(forth)
    return sum(against) + fast.SEES_THROUGH * slow_share(back)


def is_near(a: Pose, b: Pose, near: float) -> bool:
    return a.distance(b) < near and abs(angle_difference(a.theta, b.theta)) < 0.03


def slow_settled(seen: Seen, seeds: list[Pose], near: float) -> list[tuple[Pose, float, float]]:
    """Pose, share that is matched and misfit of every spot."""
    spotter = seen.spotter()
    m, c = spotter.local_map, spotter.cloud
    prior = np.full(3, fast.HELD)
    found: list[tuple[Pose, float, float]] = []
    for k, seed in enumerate(seeds):
        if any(is_near(seed, before, near) for before in seeds[:k]):
            continue
        at, _, stats = register(
            m.index, m.surface, m.ox, m.oy, c.points, c.normals, c.weights, seed.to_array(),
            prior, 0.35, 0.03, 12,
        )  # fmt: skip
        pose = Pose.from_array(at)
        if any(is_near(pose, other, near) for other, _, _ in found):
            continue
        share = stats[0] / c.weights.sum()
        found.append((pose, share, slow_misfit(seen, pose, 2, share)))
    return found


@pytest.mark.parametrize(
    ("counts", "share"),
    [
        ([3.0, 1.0, 0.0, 0.0], 0.25),
        ([0.0, 0.0, 0.0, 0.0], 0.0),
        ([0.0, 0.0, 5.0, 5.0], 0.0),
        ([0.0, 1.0, 0.0, 9.0], 0.5),  # a tenth in conflict, of which a fifth counts as judged
        ([0.0, 4.0, 0.0, 0.0], 1.0),
    ],
)
def test_conflict_is_a_share_of_what_could_be_judged(counts: list[float], share: float) -> None:
    assert fast.conflict_share(np.array(counts)) == pytest.approx(share)
    assert slow_share(np.array(counts)) == pytest.approx(share)


def test_between_is_that_of_poses() -> None:
    rng, out = np.random.default_rng(1), np.empty(3)
    for _ in range(50):
        a, b = (Pose.from_array(rng.uniform(-3.0, 3.0, 3)) for _ in range(2))
        fast.between(a.to_array(), b.to_array(), out)
        np.testing.assert_allclose(out, a.between(b).to_array(), atol=1e-12)


@pytest.mark.parametrize("most_back", [0, 1, 3])
def test_what_speaks_against_a_spot_is_the_sum_of_its_parts(
    furnished: Seen, most_back: int
) -> None:
    spotter = furnished.spotter(most_back)
    values = []
    for pose in SEEDS:
        found = fast.misfit(
            spotter.scan, spotter.latest, most_back, pose.to_array(), 0.7, TOLERANCE,
            TOLERANCE_SLOPE,
        )  # fmt: skip
        assert found == pytest.approx(slow_misfit(furnished, pose, most_back, 0.7), abs=1e-9)
        values.append(found)
    assert values[0] < min(values[3:]) - 1.0  # the truth


def test_seeds_settle_as_they_do_one_by_one(furnished: Seen) -> None:
    found = furnished.spotter().settle(SEEDS)
    expected = slow_settled(furnished, SEEDS, 0.08)
    assert len(found) == len(expected) >= 2
    # Where a scan has many points a part of them leads the way: it ends nearly where all would.
    whole = len(furnished.scan.points) < 2 * fast.APPROACHED[0]
    near, about = (1e-9, 1e-9) if whole else (1e-3, 0.02)
    for spot, (pose, share, against) in zip(found, expected, strict=True):
        np.testing.assert_allclose(spot.pose.to_array(), pose.to_array(), atol=near)
        assert spot.matched == pytest.approx(share, abs=about)
        assert spot.misfit == pytest.approx(against, abs=10.0 * about)
    best = min(found, key=lambda spot: spot.misfit)
    assert is_near(best.pose, TRUE, 0.03)


def test_each_spot_is_told_once(furnished: Seen) -> None:
    around = [TRUE @ Pose(0.1 * a, 0.1 * b, 0.0) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    once = furnished.spotter().settle([*around, *around])
    near = [spot for spot in once if spot.pose.distance(TRUE) < 0.05]
    assert len(near) == 1
    every = furnished.spotter().settle([TRUE, TRUE], near=0.0)
    assert len(every) == 2
    assert furnished.spotter().settle([]) == []


def test_without_iterations_a_spot_is_judged_where_it_is(furnished: Seen) -> None:
    seeds = [TRUE @ Pose(0.2 * k, 0.0, 0.0) for k in range(4)]
    found = furnished.spotter().settle(seeds, iterations=0, near=0.0)
    assert [spot.pose for spot in found] == seeds
    assert found[0].misfit < min(spot.misfit for spot in found[1:])


def test_a_spot_is_held_where_nothing_is_observed() -> None:
    walls = World(np.array([[-60.0, 0.0, 60.0, 0.0], [-60.0, 2.0, 60.0, 2.0]]))
    lidar = replace(sick_lms200(), range_max=8.0, range_sigma=0.0)
    at = [Pose(-0.4 * k, 1.0, 0.0) for k in range(3)]
    spotter = seen(walls, lidar, at, Pose(0.5, 1.0, 0.0)).spotter()
    for along in (-0.8, 0.3, 1.1):
        (spot,) = spotter.settle([Pose(along, 1.08, 0.03)])
        assert spot.pose.x == pytest.approx(along, abs=0.05)
        assert spot.pose.y == pytest.approx(1.0, abs=0.02)
        assert abs(spot.pose.theta) < 0.01
    far = Pose(500.0, 0.0, 0.3)
    (nowhere,) = spotter.settle([far])
    assert nowhere.pose == far
    assert nowhere.matched == 0.0
    assert math.isinf(nowhere.found.rms)


def test_scans_of_fewer_beams_are_filled_up_with_unknown(furnished: Seen) -> None:
    short, pose = furnished.latest[1]
    laid = Latest.of([furnished.latest[0], (replace(short, ranges=short.ranges[:-7]), pose)])
    assert np.isnan(laid.ranges[1, -7:]).all()
    np.testing.assert_array_equal(laid.ranges[1, :-7], short.ranges[:-7])
    first = laid.points[laid.begins[0] : laid.begins[1]]
    np.testing.assert_array_equal(first, furnished.latest[0][0].points)
    assert laid.begins[-1] == len(laid.points)
