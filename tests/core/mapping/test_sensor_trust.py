"""What the mapper does about a robot whose lidar is certainly wrong: it stays by itself."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import pytest
from lineloom_core.mapping.changes import Changes
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Mount, Scan
from lineloom_lab.simulation import Fleet, rooms, sick_lms200
from lineloom_lab.simulation.sensor_faults import in_millimetres, with_increment


@pytest.fixture(scope="module")
def log() -> list[tuple[str, Scan]]:
    """Two robots of a small flat that merge within 30 seconds."""
    fleet = Fleet.touring(rooms(3), robots=2, seed=3, duration_s=90.0, lidar=sick_lms200())
    return [(sample.robot, sample.scan) for sample in fleet.scans()]


def play(mapper: SiteMapper, entries: Iterable[tuple[str, Scan]]) -> list[Changes]:
    return [mapper.add(robot, scan) for robot, scan in entries]


def apart(mapper: SiteMapper) -> bool:
    return all(len(component.robots) == 1 for component in mapper.view().components)


def test_sound_robots_are_joined(log: list[tuple[str, Scan]]) -> None:
    mapper = SiteMapper()
    changes = play(mapper, log)
    assert any(change.merges for change in changes)
    assert all(robot.health == () for robot in mapper.view().robots.values())


def test_a_robot_with_a_wrong_increment_is_never_joined(log: list[tuple[str, Scan]]) -> None:
    mapper, fault = SiteMapper(), with_increment(0.9)
    play(mapper, ((r, fault(s) if r == "robot-2" else s) for r, s in log))
    assert apart(mapper)
    health = mapper.view().robots["robot-2"].health
    assert health[0].startswith("angle-increment: ")
    assert health[-1].startswith("not-joined: ")
    assert mapper.view().robots["robot-1"].health == ()


def test_what_was_joined_before_comes_apart_again(log: list[tuple[str, Scan]]) -> None:
    """Also across a snapshot; once the driver is restarted, the robot is trusted again."""
    mapper = SiteMapper()
    changes = play(mapper, log)
    merged = {c for change in changes for merge in change.merges for c in merge.constraints}
    assert not apart(mapper)
    broken = [(r, in_millimetres(s)) for r, s in log if r == "robot-2"][-40:]
    other = SiteMapper.resume(mapper.snapshot())
    for each in (mapper, other):
        again = play(each, ((r, _later(s, 90.0, 1000)) for r, s in broken))
        assert merged <= {c.id for change in again for c in change.withdrawn}
        assert apart(each)
    assert mapper.view().keyframes == other.view().keyframes

    session = [("robot-2", _later(s, 180.0, 0, session="2")) for r, s in log if r == "robot-2"]
    assert any(change.merges for change in play(mapper, session))
    assert mapper.view().robots["robot-2"].health == ()


def test_another_mount_is_another_chance(log: list[tuple[str, Scan]]) -> None:
    mapper = SiteMapper()
    play(mapper, ((r, in_millimetres(s)) for r, s in log[:60]))
    assert mapper.view().robots["robot-2"].health
    mapper.set_mount("robot-2", Mount(inverted=True))
    assert mapper.view().robots["robot-2"].health == ()


def _later(scan: Scan, seconds: float, seqs: int, session: str = "0") -> Scan:
    return replace(scan, stamp=scan.stamp + seconds, seq=scan.seq + seqs, session=session)
