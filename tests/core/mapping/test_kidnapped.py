"""Robots carried elsewhere: known again where that is sure, never linked or joined on looks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import pytest
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import (
    Lidar,
    SimulatedRobot,
    SimulatedScan,
    World,
    scanner_360,
    sick_lms200,
)
from lineloom_lab.simulation.aliased_buildings import rooms_in_a_row

from tests.core.mapping.drives import component_error

BAY = 4.2
AISLE = -1.1
OFF = 0.6
"""What a map may be off by [m]: a jump taken for a step puts it off by a room or more."""
Stops = Sequence[tuple[float, float]]


def inside(room: int, y: float = 2.6) -> tuple[float, float]:
    """The middle of one of eight equal rooms."""
    return BAY * (room + 0.5), y


def before_door(room: int) -> tuple[float, float]:
    return BAY * room + 1.7, AISLE


HOME = (inside(1), inside(1, 3.2), before_door(1), inside(2), before_door(2), inside(1))
"""Through two rooms and back into the first."""


def back_home(room: int) -> Stops:
    """Out of a room, along the aisle, and the way of before again."""
    stops = (before_door(room), (BAY * 6, AISLE), (BAY * 2, AISLE), inside(2), before_door(2))
    return (*stops, inside(1))


def drive(
    world: World, stops: Stops, lidar: Lidar, seed: int, heading: float | None = None
) -> list[SimulatedScan]:
    robot = SimulatedRobot.through("r", world, stops, lidar=lidar, seed=seed, heading=heading)
    return list(robot.scans())


def one_after_the_other(
    first: list[SimulatedScan], second: list[SimulatedScan], *, pause_s: float, session: str = "0"
) -> list[SimulatedScan]:
    """As one robot's stream: `seq` and the clock go on, `pause_s` between the two drives."""
    begin = first[-1].time_s + pause_s - second[0].time_s
    later = []
    for n, s in enumerate(second, start=len(first)):
        time_s = begin + s.time_s
        scan = replace(s.scan, seq=n, stamp=time_s, session=session)
        later.append(replace(s, scan=scan, time_s=time_s))
    return [*first, *later]


def carried(
    world: World,
    lidar: Lidar,
    room: int,
    seed: int,
    *,
    pause_s: float = 0.2,
    session: str = "0",
) -> tuple[list[SimulatedScan], int]:
    """Carried from room 1 to the same spot in another one, as it stood, and driven back home.

    Also returns the number of the first scan after that.
    """
    first = drive(world, HOME, lidar, seed)
    last = first[-1].true_pose
    spot = (last.x + BAY * (room - 1), last.y)
    second = drive(world, (spot, *back_home(room)), lidar, seed + 7, heading=last.theta)
    return one_after_the_other(first, second, pause_s=pause_s, session=session), len(first)


@dataclass
class Mapped:
    """What became of a robot's scans."""

    view: SiteView
    started: list[int]
    withdrawn: list[str]

    def worst(self, scans: list[SimulatedScan]) -> float:
        """Greatest error [m] in any component after a rigid alignment of its own."""
        tracked = {c for t in self.view.trajectories.values() for c in t.component if c}
        return max(component_error(self.view, scans, c).max for c in tracked)


def play(scans: list[SimulatedScan]) -> Mapped:
    mapper = SiteMapper()
    started: list[int] = []
    withdrawn: list[str] = []
    for n, s in enumerate(scans):
        changes = mapper.add(s.robot, s.scan)
        withdrawn += [c.id for c in changes.withdrawn]
        if changes.started_component:
            started.append(n)
    return Mapped(mapper.view(), started, withdrawn)


LIDARS = pytest.mark.parametrize("lidar", [sick_lms200(), scanner_360()], ids=["sick", "360"])


@pytest.mark.parametrize(
    ("pause_s", "session"),
    [(30.0, "restarted"), (0.2, "restarted"), (7200.0, "0")],
    ids=["carried while off", "restarted at once", "offline for hours"],
)
@pytest.mark.parametrize(
    ("lidar", "room"),
    [(sick_lms200(), 1), (scanner_360(), 5)],
    ids=["in place", "into another room"],
)
def test_it_starts_anew_and_is_known_again(
    lidar: Lidar, pause_s: float, session: str, room: int
) -> None:
    world = rooms_in_a_row(1).world
    scans, cut = carried(world, lidar, room, 1, pause_s=pause_s, session=session)
    mapped = play(scans)
    assert mapped.started == [0, cut]  # no link, however well the first scan fits
    assert [c.id for c in mapped.view.components] == ["c0"]  # and known again further on
    assert mapped.worst(scans) < OFF
    seq = {k.id: k.seq for k in mapped.view.keyframes}
    across = [
        c
        for c in mapped.view.constraints
        if c.kind == "sequential" and (seq[c.keyframe_a] < cut) != (seq[c.keyframe_b] < cut)
    ]
    assert across == []


@pytest.mark.parametrize(
    ("seed", "lidar", "room"),
    [
        (0, sick_lms200(), 2),
        (0, scanner_360(), 2),
        (1, scanner_360(), 3),
        (2, sick_lms200(), 3),
    ],
    ids=str,
)
def test_a_jump_between_two_scans_is_seen(seed: int, lidar: Lidar, room: int) -> None:
    scans, cut = carried(rooms_in_a_row(seed).world, lidar, room, seed)
    mapped = play(scans)
    assert len(mapped.started) == 2
    assert cut < mapped.started[1] < cut + 5
    assert mapped.worst(scans) < OFF


def test_a_jump_that_went_unseen_is_cut_by_what_comes_after() -> None:
    # Half the view is a corner that both rooms have alike: the second scan fits, 0.3 m aside.
    scans, at = carried(rooms_in_a_row(2).world, sick_lms200(), 0, 2)
    mapped = play(scans)
    assert mapped.started == [0], "the drive is no test: the jump was seen at once"
    rows = {c.id: c for c in mapped.view.constraints}
    assert len(mapped.withdrawn) == 1
    cut = rows[mapped.withdrawn[0]]
    assert (cut.kind, cut.state) == ("sequential", "retracted")
    assert "jumped here" in cut.reason
    seq = {k.id: k.seq for k in mapped.view.keyframes}
    assert at - 10 <= seq[cut.keyframe_b] <= at + 10
    assert mapped.worst(scans) < OFF


@LIDARS
@pytest.mark.parametrize("room", [2, 5])
def test_in_rooms_that_are_alike_to_the_last_chair_it_stays_apart(lidar: Lidar, room: int) -> None:
    world = rooms_in_a_row(bare=True).world
    first = drive(world, HOME, lidar, 3)
    second = drive(
        world, (inside(room), inside(room, 3.6), before_door(room), inside(room)), lidar, 4
    )
    mapped = play(one_after_the_other(first, second, pause_s=60.0, session="restarted"))
    assert [c.id for c in mapped.view.components] == ["c0", "c1"]
