"""What lasts in the map: laws, the kernel's slow twin, and people, doors, furniture and glass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.fusion.occupancy import Rays
from lineloom_core.fusion.persistence import (
    PersistenceConfig,
    lasting_stretches,
    piece_balances,
)
from lineloom_core.geometry import Pose
from lineloom_lab.simulation import World, rectangle, scanner_360, sick_lms200
from numpy.typing import NDArray

ROOM = rectangle(8.0, 5.0)
WALLS = np.array([[0, 0, 8, 0], [8, 0, 8, 5], [8, 5, 0, 5], [0, 5, 0, 0]], dtype=np.float64)
DOOR = np.array([[4.0, 1.5, 4.0, 2.5]])  # free side towards the robot at small x
HERE, THERE = Pose(1.5, 2.0, 0.0), Pose(2.0, 3.0, -0.2)
CONFIG = PersistenceConfig()


def scans(world: World, poses: Sequence[Pose], disks: NDArray[np.float64] | None = None) -> Rays:
    rng = np.random.default_rng(3)
    lidar = scanner_360()
    seen = [lidar.scan(world, p, rng, disks=disks) for p in poses]
    return Rays.of(
        [p.to_array() for p in poses],
        [(s.angle_min, s.angle_increment) for s in seen],
        [np.asarray(s.ranges) for s in seen],
    )


def joined(*parts: Rays) -> Rays:
    def rows(name: str) -> list[NDArray[np.float64]]:
        return [getattr(part, name) for part in parts]

    counts = np.concatenate([np.diff(part.starts) for part in parts])
    return Rays(
        np.vstack(rows("poses")),
        np.vstack(rows("sweeps")),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        np.concatenate(rows("ranges")),
    )


def with_door(world: World = ROOM) -> World:
    return world.with_walls(DOOR)


def length_left(lines: NDArray[np.float64], rays: Rays) -> float:
    return sum(s.end - s.begin for s in lasting_stretches(lines, rays))


def balances_twin(lines: NDArray[np.float64], rays: Rays) -> list[list[float]]:
    """Every piece against every sweep, forward, as the docstrings say it."""
    out = []
    for x1, y1, x2, y2 in lines.tolist():
        length = math.hypot(x2 - x1, y2 - y1)
        u = np.array([x2 - x1, y2 - y1]) / length
        pieces = max(round(length / CONFIG.piece), 1)
        row = []
        for p in range(pieces):
            point = np.array([x1, y1]) + (p + 0.5) * length / pieces * u
            row.append(_balance(point, u, rays))
        out.append(row)
    return out


def _balance(point: NDArray[np.float64], u: NDArray[np.float64], rays: Rays) -> float:
    balance = 1.0
    for k, (x, y, theta) in enumerate(rays.poses.tolist()):
        offset = point - (x, y)
        rho = float(np.hypot(*offset))
        height = float(u[1] * offset[0] - u[0] * offset[1])
        if not 0.15 <= rho <= CONFIG.reach or abs(height) < 0.2 * rho:
            continue
        angle_min, increment = rays.sweeps[k]
        ranges = rays.ranges[rays.starts[k] : rays.starts[k + 1]]
        bearing = (math.atan2(offset[1], offset[0]) - theta - angle_min) % (2 * math.pi)
        b = int(bearing / increment + 0.5) % round(2 * math.pi / increment)
        if b >= len(ranges) or not np.isfinite(ranges[b]):
            continue
        depth = (ranges / rho - 1.0) * abs(height)
        if abs(depth[b]) <= CONFIG.near:
            balance = min(balance + (1.0 if height > 0 else 0.0), CONFIG.most)
        elif all(depth[q] > CONFIG.far for q in (b - 1, b, b + 1) if 0 <= q < len(ranges)):
            balance = max(balance - CONFIG.loss, 0.0)
    return balance


def test_the_kernel_agrees_with_its_slow_twin() -> None:
    rng = np.random.default_rng(0)
    poses = [Pose(*rng.uniform((0.8, 0.8, -3), (7.2, 4.2, 3))) for _ in range(12)]
    rays = joined(scans(with_door(), poses[:6]), scans(ROOM, poses[6:]))
    stray = np.column_stack([rng.uniform(0.5, 7.5, (20, 1)), rng.uniform(0.5, 4.5, (20, 1))])
    lines = np.vstack([WALLS, DOOR, np.hstack([stray, stray + rng.uniform(-1, 1, (20, 2))])])
    found = piece_balances(lines, rays, CONFIG)
    expected = balances_twin(lines, rays)
    off = [
        abs(a - b) for f, e in zip(found, expected, strict=True) for a, b in zip(f, e, strict=True)
    ]
    assert np.mean(np.array(off) > 1e-9) < 0.01  # a bearing between two beams may fall to either


def test_moving_everything_changes_nothing() -> None:
    rays = joined(scans(with_door(), [HERE, THERE]), scans(ROOM, [HERE, THERE, HERE]))
    T = Pose(3.0, -7.0, 1.1)
    lines = np.vstack([WALLS, DOOR])
    moved = np.hstack([T.transform(lines[:, :2]), T.transform(lines[:, 2:])])
    for a, b in zip(
        piece_balances(lines, rays, CONFIG),
        piece_balances(moved, rays.moved(T), CONFIG),
        strict=True,
    ):
        np.testing.assert_allclose(a, b)


def test_nobody_looked_nothing_fades() -> None:
    nobody = scans(ROOM, [])
    whole = lasting_stretches(WALLS, nobody)
    assert [(s.line, s.whole) for s in whole] == [(0, True), (1, True), (2, True), (3, True)]
    assert lasting_stretches(np.empty((0, 4)), nobody) == []


def test_a_door_that_opens_fades_and_comes_back_when_it_closes() -> None:
    closed = scans(with_door(), [HERE, THERE] * 4)
    opened = scans(ROOM, [HERE, THERE] * 8)
    assert length_left(DOOR, closed) == pytest.approx(1.0)
    assert length_left(DOOR, joined(closed, opened)) == 0.0
    again = joined(closed, opened, scans(with_door(), [HERE]))
    assert length_left(DOOR, again) == pytest.approx(1.0)


def test_one_glance_through_does_not_undo_many_sightings() -> None:
    closed = scans(with_door(), [HERE, THERE] * 4)
    assert length_left(DOOR, joined(closed, scans(ROOM, [HERE] * 4))) == pytest.approx(1.0)


def test_a_person_seen_once_fades_when_the_place_is_looked_through() -> None:
    person = np.array([[3.0, 1.8, 3.0, 2.2]])
    seen = scans(ROOM, [HERE], disks=np.array([[3.2, 2.0, 0.2]]))
    assert length_left(person, seen) > 0.0
    assert length_left(person, joined(seen, scans(ROOM, [HERE, THERE] * 2))) == 0.0


def test_a_wall_seen_by_many_does_not_vanish_because_somebody_stands_before_it() -> None:
    many = scans(ROOM, [HERE, THERE] * 5)
    crowd = np.array([[2.2, y, 0.25] for y in np.arange(0.5, 4.6, 0.4)])
    blocked = joined(many, scans(ROOM, [HERE] * 60, disks=crowd))
    assert length_left(WALLS, blocked) == pytest.approx(26.0)


def test_glass_that_beams_pass_half_of_the_time_stays() -> None:
    closed, through = scans(with_door(), [HERE]), scans(ROOM, [HERE])
    assert length_left(DOOR, joined(*[closed, through] * 10)) == pytest.approx(1.0)


def test_furniture_that_was_moved_in_is_there_and_moved_out_is_gone() -> None:
    old = np.array([[3.0, 3.0, 3.0, 4.0]])
    new = np.array([[5.0, 1.0, 5.0, 2.0]])
    before = scans(ROOM.with_walls(old), [HERE, THERE] * 3)
    after = scans(ROOM.with_walls(new), [HERE, THERE] * 8)
    assert length_left(old, joined(before, after)) == 0.0
    assert length_left(new, joined(before, after)) == pytest.approx(1.0)


def test_only_the_open_doorway_is_cut_out_of_a_long_wall() -> None:
    """A closed door is flush with its wall: one line, of which a part goes."""
    wall = np.array([[4.0, 0.0, 4.0, 5.0]])
    ajar = ROOM.with_walls([[4.0, 0.0, 4.0, 1.5], [4.0, 2.5, 4.0, 5.0]])
    rays = joined(scans(ROOM.with_walls(wall), [HERE, THERE] * 4), scans(ajar, [HERE, THERE] * 8))
    left = lasting_stretches(wall, rays)
    assert [s.line for s in left] == [0, 0]
    assert not any(s.whole for s in left)
    assert left[0].begin == 0.0
    assert left[0].end == pytest.approx(1.5, abs=0.26)
    assert left[1].begin == pytest.approx(2.5, abs=0.26)
    assert left[1].end == pytest.approx(5.0)


def test_what_a_half_turn_scanner_cannot_see_is_not_judged() -> None:
    lidar, rng = sick_lms200(), np.random.default_rng(1)
    away = Pose(HERE.x, HERE.y, math.pi)  # looks away from the door
    seen = [lidar.scan(ROOM, away, rng) for _ in range(20)]
    rays = Rays.of(
        [away.to_array()] * 20,
        [(s.angle_min, s.angle_increment) for s in seen],
        [np.asarray(s.ranges) for s in seen],
    )
    assert length_left(DOOR, rays) == pytest.approx(1.0)


def test_beams_without_return_say_nothing() -> None:
    rays = scans(ROOM, [HERE] * 20)
    silent = replace(rays, ranges=np.full_like(rays.ranges, np.inf))
    assert length_left(DOOR, silent) == pytest.approx(1.0)
