"""A building: a world, the doorways in it, and the walls that tell one part from another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lineloom_lab.simulation.blueprint import Blueprint
from lineloom_lab.simulation.faults import glazed
from lineloom_lab.simulation.world import World


@dataclass(frozen=True, eq=False)
class Building:
    """One floor as the simulation knows it.

    world: all doors open. doorways: shape (k, 4), centre lines of the openings that a door can
    close [m]. telling: shape (m, 4), those walls of the world that stand nowhere else in the same
    way: what a robot must have seen to know where it is. In a building of equal rooms that is the
    furniture, in an ordinary one everything.
    """

    world: World
    doorways: NDArray[np.float64]
    telling: NDArray[np.float64]

    @staticmethod
    def of(walls: Blueprint, furniture: Blueprint) -> Building:
        """Compose a building of its walls and its furniture; the furniture is what tells."""
        drawn = Blueprint(walls.name, [*walls.segments, *furniture.segments])
        return Building(drawn.world(), _rows(walls.doorways), _rows(furniture.segments))

    @staticmethod
    def ordinary(world: World, doorways: Iterable[tuple[float, ...]] = ()) -> Building:
        """Return a world in which everything tells."""
        return Building(world, _rows(doorways), world.walls)

    @cached_property
    def is_telling(self) -> NDArray[np.bool_]:
        """Which walls of the world are telling, shape (n,)."""
        known = {tuple(row) for row in self.telling.tolist()}
        return np.array([tuple(row) in known for row in self.world.walls.tolist()], dtype=bool)

    def with_doors_closed(self, closed: NDArray[np.bool_]) -> World:
        """Return the world with some doorways shut, mask of shape (k,).

        The closed doors come after all other walls, so that those keep their numbers.
        """
        return self.world.with_walls(self.doorways[closed]) if closed.any() else self.world

    def with_glass(self, share: float, rng: np.random.Generator) -> Building:
        """Return the building with a share of its long walls turned into glass (`glazed`)."""
        return replace(self, world=glazed(self.world, share, rng))


def _rows(segments: Iterable[tuple[float, ...]]) -> NDArray[np.float64]:
    return np.array(list(segments), dtype=np.float64).reshape(-1, 4)
