"""Which places are the same, and how they lie to each other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.places import Place, Recognition, RecognitionConfig, recognise
from lineloom_lab.evaluation import pose_error
from lineloom_lab.simulation import (
    FreeSpace,
    Lidar,
    Planner,
    World,
    long_corridor,
    rectangle,
    scanner_360,
    sick_lms200,
    world_named,
)

from tests.core.places.conftest import Made, PlaceMaker, Stretch, of_one_line

AMBIGUOUS = "another hypothesis fits almost as well"


def assert_right(found: Recognition, ref: Made, cur: Made) -> None:
    assert found.T_reference_current is not None
    truth = ref.T_world_anchor.between(cur.T_world_anchor)
    error = pose_error(found.T_reference_current, truth)
    assert error.translation < 0.05
    assert error.rotation < 0.01


def test_two_drives_the_same_way_are_the_same_place(stretches: list[Stretch]) -> None:
    for s in stretches:
        found = recognise(s.forth.place, s.again.place)
        assert found.plausible, found.reason
        assert found.reason == "all checks passed"
        assert found.checks["conflict_share"] < 0.05
        assert found.checks["fit"] > 0.8
        assert_right(found, s.forth, s.again)


def test_a_drive_back_is_the_same_place(stretches: list[Stretch]) -> None:
    """Half a turn sees little in common on the way back; what it says is right all the same."""
    plausible = 0
    for s in stretches:
        found = recognise(s.forth.place, s.back.place)
        plausible += found.plausible
        if found.plausible:
            assert_right(found, s.forth, s.back)
    assert plausible >= len(stretches) - 1


def test_swapping_the_places_inverts_the_answer(stretches: list[Stretch]) -> None:
    for s in stretches:
        for other in (s.again, s.back):
            there, back = (
                recognise(s.forth.place, other.place),
                recognise(other.place, s.forth.place),
            )
            if there.T_reference_current is None or back.T_reference_current is None:
                continue
            assert there.plausible == back.plausible
            error = pose_error(back.T_reference_current.inverse(), there.T_reference_current)
            assert error.translation < 0.1
            assert error.rotation < 0.01
            assert back.evidence == pytest.approx(there.evidence, rel=0.1)


def test_different_places_are_never_plausible_unless_they_truly_overlap(
    stretches: list[Stretch],
) -> None:
    refused = 0
    for i, a in enumerate(stretches):
        for j, b in enumerate(stretches):
            if i == j:
                continue
            found = recognise(a.forth.place, b.back.place)
            if found.plausible:
                assert_right(found, a.forth, b.back)
            else:
                refused += 1
                assert found.reason
    assert refused >= 0.7 * len(stretches) * (len(stretches) - 1)


def test_the_same_places_give_the_same_answer_bit_for_bit(stretches: list[Stretch]) -> None:
    s = stretches[0]
    a, b = (recognise(s.forth.place, s.back.place) for _ in range(2))
    assert (a.plausible, a.T_reference_current, a.reason, a.evidence, a.checks) == (
        b.plausible,
        b.T_reference_current,
        b.reason,
        b.evidence,
        b.checks,
    )
    np.testing.assert_array_equal(a.information, b.information)


def test_the_information_is_symmetric_and_positive(stretches: list[Stretch]) -> None:
    for s in stretches:
        information = recognise(s.forth.place, s.again.place).information
        np.testing.assert_allclose(information, information.T)
        assert np.linalg.eigvalsh(information).min() > 0.0


def test_a_room_that_looks_the_same_turned_round_is_ambiguous() -> None:
    maker = PlaceMaker(rectangle(8.0, 5.0), scanner_360(), 4)
    a, b = maker.make([[1.5, 2.0], [6.5, 2.0]]), maker.make([[6.5, 2.1], [1.5, 2.1]])
    found = recognise(a.place, b.place)
    assert not found.plausible
    assert found.reason == AMBIGUOUS
    assert found.checks["margin"] < 0.15


@pytest.mark.parametrize("shift", [3.0, 9.0])
def test_a_corridor_that_repeats_itself_is_ambiguous(shift: float) -> None:
    maker = PlaceMaker(long_corridor(), scanner_360(), 5)
    a = maker.make([[15.0, 1.1], [20.0, 1.1]])
    b = maker.make([[15.0 + shift, 1.1], [20.0 + shift, 1.1]])
    found = recognise(a.place, b.place)
    assert not found.plausible
    assert found.reason == AMBIGUOUS


@pytest.mark.parametrize("lidar", [sick_lms200(), scanner_360()], ids=["half", "full"])
def test_a_plain_corridor_leaves_the_way_along_it_open(lidar: Lidar) -> None:
    """Either no full hypothesis arises at all, or it is refused for want of information."""
    walls = np.array([[-60.0, 0.0, 60.0, 0.0], [60.0, 2.4, -60.0, 2.4]])
    maker = PlaceMaker(World(walls), lidar, 6)
    a, b = maker.make([[0.0, 1.2], [5.0, 1.2]]), maker.make([[0.5, 1.1], [5.5, 1.1]])
    found = recognise(a.place, b.place)
    assert not found.plausible
    assert found.reason in {
        "too little in common",
        "the position along one direction is not determined",
    }


def test_what_shows_no_lines_is_known_by_what_stands_there_or_refused(
    half_turn_stretches: list[Stretch],
) -> None:
    for s in half_turn_stretches[:3]:
        bare = of_one_line(s.again.place)
        found = recognise(s.forth.place, bare)
        if found.plausible:
            assert found.checks["objects"] >= 4
            assert_right(found, s.forth, s.again)
        else:
            assert found.reason


@pytest.mark.parametrize(
    ("harder", "reason"),
    [
        ({"least_matched": 1e6}, "too few points in common"),
        ({"most_conflict": -1.0}, "walls of one place stand in free space of the other"),
        ({"least_margin": 1.5}, AMBIGUOUS),
        ({"least_information": 1e9}, "the position along one direction is not determined"),
        ({"least_overlap": 1e6}, "too little in common"),
    ],
)
def test_every_refusal_says_which_check_failed(
    half_turn_stretches: list[Stretch], harder: dict[str, float], reason: str
) -> None:
    s = half_turn_stretches[0]
    found = recognise(s.forth.place, s.again.place, replace(RecognitionConfig(), **harder))  # type: ignore[arg-type]
    assert not found.plausible
    assert found.reason == reason


def test_anchors_may_be_turned_at_will() -> None:
    """The frame of a place is its robot's own business."""
    maker = PlaceMaker(world_named("office", 0), scanner_360(), 8)
    space = FreeSpace.of(maker.world)
    path = Planner(space).path(*(space.centre(*space.nearest_cell(x, 8.0)) for x in (6.0, 16.0)))
    poses = maker.poses(path)
    glimpses = [maker.glimpses(poses, poses[5]) for _ in range(2)]
    T = Pose(1.0, -2.0, math.radians(100.0))
    moved = [replace(g, T_anchor_laser=T @ g.T_anchor_laser) for g in glimpses[1]]
    ref, cur, turned = (Place(0, 0, 0, tuple(seen)) for seen in (*glimpses, moved))
    for found, truth in (
        (recognise(ref, cur), Pose.identity()),
        (recognise(ref, turned), T.inverse()),
        (recognise(turned, ref), T),
    ):
        assert found.plausible, found.reason
        assert found.T_reference_current is not None
        error = pose_error(found.T_reference_current, truth)
        assert error.translation < 0.01
        assert error.rotation < 0.005
