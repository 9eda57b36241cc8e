"""What holds for the features of every scan: turning, mirroring, order, orientation, spread."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.features import EDGE, INTERIOR, UNKNOWN, ScanFeatures, extract_features
from lineloom_core.features._kernels import (
    COUNT,
    FIRST,
    LAST,
    LENGTH,
    OFFSET,
    THETA,
    VAR_OFFSET,
    VAR_THETA,
    X1,
    X2,
    Y1,
    Y2,
)
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.scan import Scan
from lineloom_lab.simulation import (
    FreeSpace,
    Lidar,
    World,
    scanner_360,
    sick_lms200,
    world_named,
)
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@pytest.fixture(scope="module", params=["half turn", "full turn"])
def scans(request: pytest.FixtureRequest) -> list[Scan]:
    """Twelve noisy scans of a furnished floor, some beams without return."""
    lidar = sick_lms200() if request.param == "half turn" else scanner_360()
    lidar = replace(lidar, dropout=0.03)
    world = world_named("office", 2)
    space = FreeSpace.of(world)
    rng = np.random.default_rng(9)
    return [lidar.scan(world, space.random_pose(rng), rng) for _ in range(12)]


def assert_same_features(a: ScanFeatures, b: ScanFeatures, *, atol: float = 1e-7) -> None:
    np.testing.assert_allclose(a.lines, b.lines, atol=atol)
    np.testing.assert_array_equal(a.ends, b.ends)
    np.testing.assert_allclose(a.edges, b.edges, atol=atol)
    np.testing.assert_allclose(a.points, b.points, atol=atol)
    np.testing.assert_array_equal(a.beams, b.beams)
    np.testing.assert_array_equal(a.breaks, b.breaks)


@pytest.mark.parametrize("turn", [0.7, -2.0, math.pi])
def test_turning_the_sweep_turns_its_features(scans: list[Scan], turn: float) -> None:
    R = Pose(0.0, 0.0, turn)
    for scan in scans:
        before = extract_features(scan)
        after = extract_features(replace(scan, angle_min=scan.angle_min + turn))
        assert len(before) > 1
        ends = before.lines[:, :4].reshape(-1, 2)
        np.testing.assert_allclose(after.lines[:, :4].reshape(-1, 2), R.transform(ends), atol=1e-7)
        change = wrap_array(after.lines[:, THETA] - before.lines[:, THETA] - turn)
        np.testing.assert_allclose(change, 0.0, atol=1e-7)
        np.testing.assert_allclose(after.lines[:, OFFSET:], before.lines[:, OFFSET:], atol=1e-7)
        np.testing.assert_array_equal(after.ends, before.ends)
        np.testing.assert_allclose(
            after.edges.reshape(-1, 2), R.transform(before.edges.reshape(-1, 2)), atol=1e-6
        )


def test_a_clockwise_sweep_has_the_features_of_the_counter_clockwise_one(
    scans: list[Scan],
) -> None:
    for scan in scans:
        last = scan.angle_min + (len(scan) - 1) * scan.angle_increment
        backward = replace(
            scan,
            ranges=scan.ranges[::-1],
            angle_min=last,
            angle_increment=-scan.angle_increment,
        )
        assert_same_features(extract_features(backward), extract_features(scan))


def test_a_lidar_upside_down_gives_the_features_of_the_upright_one(scans: list[Scan]) -> None:
    for scan in scans:
        # Upside down, the same room is swept clockwise: what is left comes under negative angles.
        inverted = replace(scan, angle_min=-scan.angle_min, angle_increment=-scan.angle_increment)
        assert_same_features(extract_features(inverted, inverted=True), extract_features(scan))


def test_lines_are_oriented_with_the_sensor_on_their_left(scans: list[Scan]) -> None:
    for scan in scans:
        lines = extract_features(scan).lines
        along = lines[:, [X2, Y2]] - lines[:, [X1, Y1]]
        to_sensor = -lines[:, [X1, Y1]]
        assert np.all(along[:, 0] * to_sensor[:, 1] - along[:, 1] * to_sensor[:, 0] > 0.0)


def test_the_columns_of_a_line_agree_with_each_other(scans: list[Scan]) -> None:
    for scan in scans:
        features = extract_features(scan)
        lines = features.lines
        along = lines[:, [X2, Y2]] - lines[:, [X1, Y1]]
        normal = np.column_stack([-np.sin(lines[:, THETA]), np.cos(lines[:, THETA])])
        np.testing.assert_allclose(np.hypot(*along.T), lines[:, LENGTH], atol=1e-9)
        np.testing.assert_allclose(np.arctan2(along[:, 1], along[:, 0]), lines[:, THETA], atol=1e-9)
        for x, y in ((X1, Y1), (X2, Y2)):
            np.testing.assert_allclose(
                np.sum(normal * lines[:, [x, y]], axis=1), lines[:, OFFSET], atol=1e-9
            )
        assert np.all(lines[:, LENGTH] >= 0.2)
        assert np.all(lines[:, COUNT] >= 5)
        assert np.all(lines[:, [VAR_THETA, VAR_OFFSET]] > 0.0)
        assert np.all(lines[:, FIRST] <= lines[:, LAST])
        bare = features.ends != EDGE
        np.testing.assert_array_equal(features.edges[bare], lines[:, :4].reshape(-1, 2, 2)[bare])


def test_every_return_is_a_point_exactly_once(scans: list[Scan]) -> None:
    for scan in scans:
        features = extract_features(scan)
        np.testing.assert_array_equal(
            np.sort(features.beams), np.flatnonzero(np.isfinite(scan.ranges))
        )
        r, a = scan.ranges[features.beams], scan.angles[features.beams]
        np.testing.assert_allclose(
            features.points, np.column_stack([r * np.cos(a), r * np.sin(a)]), atol=1e-9
        )
        assert features.breaks[-1]


@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf])
def test_a_sweep_without_returns_has_no_features(nothing: float) -> None:
    scan = Scan.checked(
        [nothing] * 181,
        angle_min=-math.pi / 2,
        angle_increment=math.pi / 180,
        range_min=0.0,
        range_max=30.0,
        stamp=0.0,
    )
    features = extract_features(scan)
    assert len(features) == 0
    assert features.lines.shape == (0, 12)
    assert features.ends.shape == (0, 2)
    assert features.edges.shape == (0, 2, 2)
    assert features.points.shape == (0, 2)
    assert features.normals().shape == (0, 2)


@pytest.mark.parametrize("beams", [1, 2, 4])
def test_a_few_beams_are_points_and_no_lines(beams: int) -> None:
    scan = Scan.checked(
        np.full(beams, 2.0),
        angle_min=0.0,
        angle_increment=0.2,
        range_min=0.0,
        range_max=30.0,
        stamp=0.0,
    )
    features = extract_features(scan)
    assert len(features) == 0
    assert features.points.shape == (beams, 2)


def test_the_said_variances_are_those_of_repeated_measurements() -> None:
    """A wall straight ahead, 600 times: the spread of its direction and distance is as said."""
    lidar = Lidar(-0.4, math.radians(1.0), 46, range_sigma=0.015)
    wall = World(np.array([[3.0, -6.0, 3.0, 6.0]]))
    rng = np.random.default_rng(4)
    lines = np.array(
        [extract_features(lidar.scan(wall, Pose.identity(), rng)).lines[0] for _ in range(600)]
    )
    said_theta, said_offset = lines[:, [VAR_THETA, VAR_OFFSET]].mean(axis=0)
    # The wall is seen symmetrically, so that its centroid is the foot of the perpendicular.
    assert lines[:, THETA].mean() == pytest.approx(math.pi / 2, abs=0.002)
    assert lines[:, OFFSET].mean() == pytest.approx(-3.0, abs=0.002)
    assert 0.7 < np.var(lines[:, THETA]) / said_theta < 1.1
    assert 0.7 < np.var(lines[:, OFFSET]) / said_offset < 1.1


def test_the_same_scan_has_the_same_features_bit_for_bit(scans: list[Scan]) -> None:
    seen: set[int] = set()
    for scan in scans:
        a, b = extract_features(scan), extract_features(replace(scan, stamp=99.0))
        for name in ("lines", "ends", "edges", "points", "beams", "breaks"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        seen |= set(np.unique(a.ends).tolist())
    assert seen == {INTERIOR, EDGE, UNKNOWN}
