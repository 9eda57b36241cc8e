"""The fleets that the probability of joining is fitted on: many lidars, buildings and heights.

Everything is drawn from a seed. Lidars of one fleet may hang at different heights: each then sees
pieces of furniture that the others pass over. Drives last from seconds to minutes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import networkx as nx
import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Mount

from lineloom_lab.evaluation.merge_bench_buildings import ALIASED, building_classes
from lineloom_lab.evaluation.merge_bench_fleets import BenchFleet, BenchRobot
from lineloom_lab.simulation import (
    Fleet,
    FreeSpace,
    Lidar,
    SimulatedRobot,
    World,
    corridors,
    rectangle,
    rooms,
)
from lineloom_lab.simulation.building import Building
from lineloom_lab.simulation.clutter import cluttered

DURATIONS_S = (15.0, 25.0, 40.0, 60.0)
_BEAMS = (45, 90, 181, 360, 720, 1080)
_VIEWS_DEG = (90.0, 180.0, 240.0, 270.0, 360.0)
_REACH_M = (4.0, 6.0, 8.0, 12.0, 30.0)
_UNSEEN = 0.35  # share of the furniture that a lidar at another height passes over
_CORNER_M = 1e-3  # to which two ends of segments are one corner


def join_buildings() -> dict[str, Callable[[int], list[Building]]]:
    """The floors of a site by the kind of building; robots of different floors never meet."""
    drawn = {
        kind.name: kind.draw
        for kind in building_classes(None)
        if kind.kind == ALIASED or kind.name in ("office", "different buildings")
    }
    return drawn | {
        "flat": lambda seed: [_furnished(rooms(seed), seed)],
        "corridors": lambda seed: [_furnished(corridors(seed), seed)],
        "single room": lambda seed: [_furnished(_room(seed), seed)],
        "two rooms alike": lambda seed: [_furnished(_room(seed), seed + i) for i in range(2)],
    }


def join_fleet(kind: str, seed: int) -> BenchFleet:
    """Draw two or three robots in a building of a kind."""
    rng = np.random.default_rng([seed, 41, list(join_buildings()).index(kind)])
    floors = join_buildings()[kind](seed)
    duration = float(rng.choice(DURATIONS_S))
    heights = int(rng.choice([1, 1, 2, 3]))
    count = int(rng.integers(2, 4))
    alike = random_lidar(rng) if rng.random() < 0.5 else None
    members: list[BenchRobot] = []
    for number, floor in enumerate(floors):
        here = len(range(number, count, len(floors)))
        if not here:
            continue
        levels = [floor.world] + [seen_from_another_height(floor, rng) for _ in range(heights - 1)]
        shared = float(rng.choice([0.25, 0.45, 0.7]))
        for robot in _tours(floor, here, shared, duration, rng):
            level = levels[int(rng.integers(heights))]
            drawn = replace(robot, world=level, lidar=alike or random_lidar(rng))
            drawn = replace(drawn, mount=Mount(Pose(0.1, 0.0, 0.0), inverted=False))
            members.append(BenchRobot(drawn, floor, number, False))
    named = [
        replace(m, simulated=replace(m.simulated, name=f"robot-{i}", seed=1000 * seed + i))
        for i, m in enumerate(members)
    ]
    return BenchFleet(tuple(named))


def random_lidar(rng: np.random.Generator) -> Lidar:
    """45 to 1080 beams over 90 to 360 degrees, a reach of 4 to 30 m, noise of 5 to 50 mm."""
    beams, view = int(rng.choice(_BEAMS)), math.radians(float(rng.choice(_VIEWS_DEG)))
    sigma = 1e-3 * math.exp(float(rng.uniform(math.log(5.0), math.log(50.0))))
    full = view > math.tau - 0.1
    return Lidar(
        -0.5 * view, view / (beams if full else beams - 1), beams, range_min=0.1,
        range_max=float(rng.choice(_REACH_M)), range_sigma=sigma, range_clip=3.0 * sigma,
        dropout=float(rng.choice([0.0, 0.01, 0.03])), rate_hz=5.0,
    )  # fmt: skip


def seen_from_another_height(floor: Building, rng: np.random.Generator) -> World:
    """The floor without some whole pieces of its furniture."""
    walls, telling = floor.world.walls, np.flatnonzero(floor.is_telling)
    corners = nx.Graph()
    for row in telling.tolist():
        ends = [tuple(np.round(walls[row, i : i + 2] / _CORNER_M).astype(int)) for i in (0, 2)]
        corners.add_edge(*ends)
    piece = {c: i for i, found in enumerate(nx.connected_components(corners)) for c in found}
    unseen = rng.random(max(piece.values(), default=-1) + 1) < _UNSEEN
    kept = np.ones(len(walls), dtype=bool)
    for row in telling.tolist():
        kept[row] = not unseen[piece[tuple(np.round(walls[row, :2] / _CORNER_M).astype(int))]]
    return World(walls[kept], floor.world.name, floor.world.glass)


def _tours(
    floor: Building, count: int, shared: float, duration: float, rng: np.random.Generator
) -> tuple[SimulatedRobot, ...]:
    return Fleet.touring(
        floor.world,
        robots=count,
        seed=int(rng.integers(2**31)),
        duration_s=duration,
        shared=shared,
        speed=float(rng.uniform(0.4, 0.8)),
        people=int(rng.integers(0, 3)),
    ).robots


def _room(seed: int) -> World:
    rng = np.random.default_rng([seed, 43])
    return rectangle(float(rng.uniform(4.0, 11.0)), float(rng.uniform(3.5, 7.0)))


def _furnished(world: World, seed: int) -> Building:
    """A world with clutter of its own, which alone is what lidars of other heights may miss."""
    rng = np.random.default_rng([seed, 42])
    full = cluttered(FreeSpace.of(world), rng, pieces_per_m2=float(rng.choice([0.06, 0.12, 0.25])))
    return Building(full, np.empty((0, 4)), full.walls[len(world.walls) :])
