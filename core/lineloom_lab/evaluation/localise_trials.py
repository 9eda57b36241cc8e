"""Questions to `localise` whose answers are known: simulated maps, and scans from in and around.

A map is made by two robots that drive through a part of a building, with the mapper's own errors in
it. The questions come from all over that building, mapped or not, and from another building of the
same kind, with people standing about; one scan each, or the scans of a few metres of driving.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.localisation import Localisation, PoseHypothesis
from lineloom_core.mapping.answers.site_view import KeyframeView
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Scan

from lineloom_lab.evaluation.simulated_pairs import bystanders
from lineloom_lab.simulation import (
    Fleet,
    FreeSpace,
    Lidar,
    Planner,
    SimulatedRobot,
    World,
    corridors,
    long_corridor,
    office_floor,
    rooms,
)
from lineloom_lab.simulation.aliased_buildings import hotel_floor, rooms_in_a_row

KINDS: dict[str, Callable[[int], World]] = {
    "office": office_floor,
    "rooms": rooms,
    "corridors": corridors,
    "rooms in a row": lambda seed: rooms_in_a_row(seed).world,
    "hotel floor": lambda seed: hotel_floor(seed).world,
    "long corridor": lambda seed: long_corridor(),
    "identical rooms": lambda seed: rooms_in_a_row(seed, bare=True).world,
}
"""The last two look the same again and again: there, "ambiguous" is the right answer."""

RIGHT_WITHIN = (0.5, np.radians(8.0))
MAPPED_WITHIN = 1.5
_PEOPLE = 4
_RUN_S = 8.0


@dataclass(frozen=True, eq=False)
class Trial:
    """One question and its answer.

    kind: of building. run: whether it was a run of scans. foreign: taken in another building.
    mapped: whether a keyframe lies within 1.5 m of the true pose. right: whether the first
    hypothesis is the truth.
    """

    kind: str
    run: bool
    foreign: bool
    mapped: bool
    right: bool
    answer: Localisation

    @property
    def wrongly_unique(self) -> bool:
        """The answer that must not be given."""
        return self.answer.verdict == "unique" and not self.right


@dataclass(frozen=True, eq=False)
class _Charted:
    """A map, and the true pose (in the world) of each of its keyframes."""

    world: World
    mapper: SiteMapper
    keyframes: tuple[tuple[KeyframeView, Pose], ...]

    def is_mapped(self, pose: Pose) -> bool:
        return min(true.distance(pose) for _, true in self.keyframes) < MAPPED_WITHIN

    def is_right(self, h: PoseHypothesis, true: Pose) -> bool:
        """Compared with the nearest keyframe, so that the map's own drift does not count."""
        members = [(k, t) for k, t in self.keyframes if k.component == h.component]
        near, T_world_near = min(members, key=lambda m: m[0].pose.distance(h.pose))
        off = near.pose.between(h.pose).between(T_world_near.between(true))
        return bool(np.hypot(off.x, off.y) < RIGHT_WITHIN[0] and abs(off.theta) < RIGHT_WITHIN[1])


def trials(kind: str, seed: int, lidar: Lidar, count: int, duration_s: float) -> Iterator[Trial]:
    """Chart one building of a kind for `duration_s`, then ask `count` questions about it."""
    rng = np.random.default_rng([seed, len(kind), lidar.beams])
    charted = _chart(KINDS[kind](seed), lidar, seed, duration_s)
    other = KINDS[kind](seed + 1000)
    for number in range(count):
        foreign, run = number % 4 == 3, number % 2 == 1
        world = other if foreign else charted.world
        scans, true = _question(world, lidar, rng, run=run)
        answer = charted.mapper.localise(scans)
        yield Trial(
            kind=kind,
            run=run,
            foreign=foreign,
            mapped=not foreign and charted.is_mapped(true),
            right=not foreign
            and bool(answer.hypotheses)
            and charted.is_right(answer.hypotheses[0], true),
            answer=answer,
        )


def _chart(world: World, lidar: Lidar, seed: int, duration_s: float) -> _Charted:
    fleet = Fleet.touring(world, robots=2, seed=seed, duration_s=duration_s, lidar=lidar, people=2)
    mapper, truth = SiteMapper(), dict[str, Pose]()
    for s in fleet.scans():
        keyframe = mapper.add(s.robot, s.scan).keyframe
        if keyframe is not None:
            truth[keyframe] = s.true_pose
    keyframes = tuple((k, truth[k.id]) for k in mapper.view().keyframes)
    return _Charted(world, mapper, keyframes)


def _question(
    world: World, lidar: Lidar, rng: np.random.Generator, *, run: bool
) -> tuple[list[Scan], Pose]:
    """Scans of one robot and the true pose of the latest."""
    space = FreeSpace.of(world)
    here = space.random_pose(rng)
    if not run:
        return [lidar.scan(world, here, rng, disks=bystanders(here, rng, _PEOPLE))], here
    robot = SimulatedRobot.wandering(
        "asker",
        world,
        lidar=lidar,
        seed=int(rng.integers(1 << 30)),
        duration_s=_RUN_S,
        start=here,
        planner=Planner(space),
    )
    seen = list(robot.scans())
    return [s.scan for s in seen], seen[-1].true_pose
