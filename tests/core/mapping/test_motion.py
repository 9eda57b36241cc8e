"""What a robot's next step may be: laws of `motion`, whatever its clock does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate

import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.facts.motion import PAUSE, Expected, Motion

DRIVE = Pose(0.9, 0.0, 0.05)
TURN = Pose(0.0, 0.0, math.pi / 2)
SLOW = Pose(0.1, 0.0, 0.02)
UNEVEN = [DRIVE, DRIVE, Pose(0.6, 0.1, 0.4), DRIVE, Pose(1.1, 0.0, -0.3), DRIVE, DRIVE]


def way(steps: Sequence[Pose]) -> list[Pose]:
    return list(accumulate(steps, lambda at, step: at @ step, initial=Pose(3.0, -2.0, 0.4)))


def moved(steps: Sequence[Pose], stamps: Sequence[float]) -> Motion:
    """After a scan at the beginning and one after each step; a stamp for each."""
    motion = Motion()
    poses = way(steps)
    motion.begin(poses[0], stamps[0])
    for pose, stamp in zip(poses[1:], stamps[1:], strict=True):
        motion.add(pose, stamp)
    return motion


def steadily(steps: Sequence[Pose], interval: float = 0.5) -> tuple[Motion, float]:
    """After these steps, one an interval, and the stamp that is due next."""
    stamps = [interval * k for k in range(len(steps) + 1)]
    return moved(steps, stamps), interval * len(stamps)


def assert_alike(found: Expected, expected: Expected) -> None:
    assert len(found.predictions) == len(expected.predictions)
    for a, b in zip(found.predictions, expected.predictions, strict=True):
        assert a.distance(b) < 1e-9
        assert abs(angle_difference(a.theta, b.theta)) < 1e-9
    assert found.width == pytest.approx(expected.width)
    assert found.turn == pytest.approx(expected.turn)
    assert found.gap == pytest.approx(expected.gap)
    assert found.steady == expected.steady


def holds(expected: Expected, pose: Pose) -> bool:
    return any(
        p.distance(pose) < 0.05 and abs(angle_difference(p.theta, pose.theta)) < 0.05
        for p in expected.predictions
    )


@pytest.mark.parametrize("factor", [0.3, 3.0, 20.0])
@pytest.mark.parametrize("due", [8.5, 9.3, 12.5])
@pytest.mark.parametrize("steps", [UNEVEN, [SLOW] * 7], ids=["uneven", "even"])
def test_only_ratios_of_intervals_count(steps: list[Pose], due: float, factor: float) -> None:
    stamps = [1.0, 2.0, 3.1, 3.9, 5.0, 6.5, 7.0, 8.0]
    expected = moved(steps, stamps).expect(due)
    found = moved(steps, [factor * t for t in stamps]).expect(factor * due)
    assert_alike(found, expected)


@pytest.mark.parametrize(
    "clock", [lambda _: 7.0, lambda k: -0.5 * k, lambda k: 1e6 - k], ids=["stands", "back", "far"]
)
@pytest.mark.parametrize("steps", [UNEVEN, [SLOW] * 7], ids=["uneven", "even"])
def test_a_clock_that_stands_or_goes_back_is_as_good_as_a_regular_one(steps, clock) -> None:  # type: ignore[no-untyped-def]
    regular, due = steadily(steps)
    odd = moved(steps, [clock(k) for k in range(len(steps) + 1)])
    assert_alike(odd.expect(clock(len(steps) + 1)), regular.expect(due))


def test_a_single_stamp_that_goes_back_says_nothing() -> None:
    motion, due = steadily(UNEVEN)
    assert_alike(motion.expect(-3.0), motion.expect(due))


def test_the_next_step_is_like_the_last_in_what_time_there_was() -> None:
    motion, due = steadily([SLOW] * 5)
    last = way([SLOW] * 5)[-1]
    for stretch in (0.5, 1.0, 1.8):
        (predicted,) = motion.expect(due + (stretch - 1.0) * 0.5).predictions
        assert last.between(predicted).x == pytest.approx(0.1 * stretch)
        assert last.between(predicted).theta == pytest.approx(0.02 * stretch)


def test_a_step_that_took_longer_was_slower() -> None:
    steps = [*[SLOW] * 4, Pose(0.2, 0.0, 0.04)]
    motion = moved(steps, [0.0, 1.0, 2.0, 3.0, 4.0, 6.0])
    (predicted,) = motion.expect(7.1).predictions
    assert way(steps)[-1].between(predicted).x == pytest.approx(0.1, abs=0.02)


def test_a_pause_widens_and_its_end_knows_no_velocity() -> None:
    motion, due = steadily([SLOW] * 6)
    last = way([SLOW] * 6)[-1]
    steady, paused = motion.expect(due), motion.expect(due + 0.5 * (PAUSE + 2.0))
    assert steady.steady
    assert not paused.steady
    assert paused.gap == pytest.approx(PAUSE + 3.0)
    assert paused.width > 2.0 * steady.width
    assert paused.turn > 2.0 * steady.turn
    assert holds(paused, last)  # it may have stood
    driven_on = max(last.distance(p) for p in paused.predictions)
    assert driven_on == pytest.approx(0.1 * paused.gap, abs=0.02)  # or gone on as it did
    assert motion.expect(due + 60.0).predictions == (last,)
    assert motion.expect(due + 60.0).width == paused.width


def test_who_begins_is_known_within_a_step_only() -> None:
    motion = Motion()
    motion.begin(Pose(1.0, 2.0, 3.0), 5.0)
    expected = motion.expect(5.5)
    assert expected.predictions == (Pose(1.0, 2.0, 3.0),)
    assert expected.gap == 1.0
    assert not expected.steady


def test_small_and_even_steps_are_steady_and_large_ones_are_not() -> None:
    for steps, steady in (
        ([SLOW] * 3, True),
        ([SLOW], False),  # one step is no habit
        ([DRIVE] * 5, False),
        ([Pose(0.05, 0.0, 0.5)] * 5, False),
        ([SLOW, SLOW, DRIVE], False),
        ([DRIVE, *[SLOW] * 20], True),  # a large step is forgotten
    ):
        motion, due = steadily(steps)
        assert motion.expect(due).steady == steady, steps
    small, large = (steadily([s] * 5) for s in (SLOW, DRIVE))
    assert small[0].expect(small[1]).width < large[0].expect(large[1]).width
    assert large[0].usual[0] == pytest.approx(0.9)


@pytest.mark.parametrize("last", [DRIVE, TURN], ids=["after driving", "after turning"])
def test_who_turns_and_drives_in_turns_may_do_either(last: Pose) -> None:
    first = TURN if last is DRIVE else DRIVE
    steps = [first, last] * 3
    motion, due = steadily(steps)
    here, expected = way(steps)[-1], motion.expect(due)
    assert holds(expected, here @ DRIVE)
    assert holds(expected, here @ TURN)
    assert len(expected.predictions) == 2  # each kind once
    assert expected.predictions[0].distance(here @ last) < 1e-9  # first: as just now


def test_a_kind_of_step_is_forgotten() -> None:
    motion, due = steadily([TURN, *[DRIVE] * 8])
    assert not holds(motion.expect(due), way([TURN, *[DRIVE] * 8])[-1] @ TURN)


def test_nothing_surprises_where_it_was_predicted() -> None:
    expected = Expected((Pose(1.0, 2.0, 0.5), Pose(4.0, 2.0, 3.1)), 0.3, 0.2, 1.0, False)
    for predicted in expected.predictions:
        assert expected.surprise(predicted) == 0.0
        assert expected.explains(predicted)
        assert expected.nearest(predicted) == predicted
        for off in (Pose(0.4, 0.1, 0.0), Pose(0.0, 0.0, 0.3), Pose(-0.2, 0.3, -0.1)):
            either_way = [
                expected.surprise(Pose(predicted.x + s * off.x, predicted.y + s * off.y,
                                       predicted.theta + t * off.theta))
                for s in (-1, 1) for t in (-1, 1)
            ]  # fmt: skip
            assert either_way == pytest.approx([either_way[0]] * 4)
            assert either_way[0] > 0.0


def test_surprise_grows_and_its_tails_are_heavy() -> None:
    expected = Expected((Pose.identity(),), 0.3, 0.2, 1.0, False)
    values = [expected.surprise(Pose(x, 0.0, 0.0)) for x in (0.0, 0.1, 0.3, 1.0, 3.0, 10.0)]
    assert values == sorted(values)
    assert values[2] == pytest.approx(math.log(2.0))  # at one width
    assert values[-1] < 8.0  # a Gaussian would say 556
    assert expected.explains(Pose(0.29, 0.0, 0.19))
    assert not expected.explains(Pose(0.31, 0.0, 0.0))
    assert not expected.explains(Pose(0.0, 0.0, 0.21))


def test_who_has_not_driven_has_shown_no_pace() -> None:
    still, due = steadily([Pose.identity()] * 30)
    assert still.expect(due).steady
    assert not still.expect(due).paced
    driving, due = steadily([Pose(0.1, 0.0, 0.0)] * 30)
    assert driving.expect(due).paced


def test_a_step_is_like_another_in_way_and_turn_together() -> None:
    turn, drive = Pose(0.0, 0.0, -0.7), Pose(2.0, 0.0, 0.1)
    expected = Expected((turn, drive), 0.6, 0.5, 1.0, False)
    short = Pose(0.4, 0.0, 0.0)  # nearer to the turn's way, but no turn
    assert expected.nearest(short) == turn
    assert expected.surprise(short) > 1.0
    assert expected.surprise(Pose(2.4, 0.0, 0.0)) < 0.5


def test_what_wheels_say_comes_last() -> None:
    motion, due = steadily(UNEVEN)
    rolled = Pose(9.0, 9.0, 1.0)
    expected = motion.expect(due)
    with_wheels = expected.with_wheels(rolled)
    assert with_wheels.predictions == (*expected.predictions, rolled)
    assert with_wheels.surprise(rolled) == 0.0


def test_a_stored_motion_goes_on_as_it_would_have() -> None:
    motion, due = steadily(UNEVEN)
    restored = decode(encode(motion), Motion)
    assert restored.expect(due) == motion.expect(due)
    assert restored.turn_rate == motion.turn_rate
