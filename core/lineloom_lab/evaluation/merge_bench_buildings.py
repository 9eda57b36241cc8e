"""The buildings of the merge benchmark, by class: each call draws the floors of one site."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lineloom_lab.simulation import FreeSpace, World, corridors, rooms
from lineloom_lab.simulation.aliased_buildings import (
    hotel_floor,
    rooms_in_a_row,
    self_similar_corridor,
    symmetric_hall,
)
from lineloom_lab.simulation.building import Building
from lineloom_lab.simulation.clutter import cluttered, cropped
from lineloom_lab.simulation.office import office_building

ALIASED, ORDINARY, UNDECIDABLE = "aliased", "ordinary", "undecidable"
_CROP_M = 32.0
_LEAST_AREA_M2 = 120.0
_TRIES = 40


@dataclass(frozen=True, slots=True)
class BuildingClass:
    """A kind of site. kind: aliased, ordinary or undecidable. draw: a seed's floors.

    Robots on different floors of a site must never be joined.
    """

    name: str
    kind: str
    draw: Callable[[int], list[Building]]


def building_classes(floor_plans: Path | None) -> tuple[BuildingClass, ...]:
    """Return all classes; real floor plans (*.txt) only where their folder is there."""
    classes = [
        BuildingClass("rooms in a row", ALIASED, lambda seed: [rooms_in_a_row(seed)]),
        BuildingClass("hotel floor", ALIASED, lambda seed: [hotel_floor(seed)]),
        BuildingClass("two floors, same walls", ALIASED, _two_floors),
        BuildingClass("self-similar corridor", ALIASED, lambda s: [self_similar_corridor(s)]),
        BuildingClass("symmetric hall", ALIASED, lambda seed: [symmetric_hall(seed)]),
        BuildingClass("office", ORDINARY, lambda seed: [office_building(seed)]),
        BuildingClass("small flat", ORDINARY, lambda seed: [Building.ordinary(rooms(seed))]),
        BuildingClass("corridors", ORDINARY, lambda seed: [Building.ordinary(corridors(seed))]),
        BuildingClass("different buildings", ORDINARY, _strangers),
    ]
    plans = sorted(floor_plans.glob("*.txt")) if floor_plans is not None else []
    if plans:
        classes.append(BuildingClass("real floor plans", ORDINARY, lambda s: [_plan(plans, s)]))
    classes.append(BuildingClass("alike to the last chair", UNDECIDABLE, _identical))
    return tuple(classes)


def _two_floors(seed: int) -> list[Building]:
    """Two floors of the same walls: furniture of its own on each."""
    kind = seed % 3
    if kind == 0:
        return [office_building(seed, 2 * seed), office_building(seed, 2 * seed + 1)]
    build = rooms_in_a_row if kind == 1 else hotel_floor
    return [build(2 * seed), build(2 * seed + 1)]


def _strangers(seed: int) -> list[Building]:
    """Four buildings whose robots are posted to one site by mistake."""
    offices = [office_building(7 * seed + i) for i in range(2)]
    return [*offices, Building.ordinary(rooms(seed)), Building.ordinary(corridors(seed))]


def _identical(seed: int) -> list[Building]:
    """Places that nobody can tell apart: equal floors, or nothing but equal walls."""
    kind = seed % 4
    if kind == 0:
        return [hotel_floor(seed), hotel_floor(seed)]
    if kind == 1:
        return [rooms_in_a_row(seed, bare=True)]
    if kind == 2:
        return [self_similar_corridor(seed, bare=True)]
    return [symmetric_hall(seed, bare=True)]


def _plan(plans: list[Path], seed: int) -> Building:
    """A part of a real building with furniture drawn into it: plans show walls alone."""
    rng = np.random.default_rng([seed, 21])
    world = World.from_text(plans[seed % len(plans)])
    for _ in range(_TRIES):
        part = cropped(world, _CROP_M, rng)
        if part is not None:
            space = FreeSpace.of(part)
            if space.area >= min(_LEAST_AREA_M2, 0.5 * FreeSpace.of(world).area):
                return Building.ordinary(cluttered(space, rng))
    raise ValueError(f"floor plan {world.name!r} has no part where robots can drive about")
