"""Place recognition's compiled steps against their slow, obvious twins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching import _free_space_kernels, _proposal_kernels
from lineloom_core.matching.free_space import TOLERANCE, TOLERANCE_SLOPE
from lineloom_core.places import Place
from lineloom_core.places import _kernels as fast
from lineloom_core.places.place import count_points, count_steady

from tests.core.places import slow_twins as slow
from tests.core.places.conftest import Stretch

ARGS = (TOLERANCE, TOLERANCE_SLOPE)
# Compiled functions carry no types.
judge_places: Any = fast.judge_places
match_places: Any = fast.match_places
tally_sweeps: Any = fast.tally_sweeps
propose: Any = _proposal_kernels.propose
PROPOSING = (8, 12, 0.25, 80, 0.25, 16.0, 0.3)


def lines_of(place: Place) -> tuple[Any, ...]:
    return place.lines, place.ends, place.edges


def sweeps_of(place: Place) -> tuple[Any, ...]:
    return (
        place.surface.points, place.ranges, place.angle_mins, place.angle_increments,
        place.sweep_poses,
    )  # fmt: skip


def matched(ref: Place, cur: Place, least_explained: float) -> Any:
    return match_places(
        *lines_of(ref), *sweeps_of(ref), *lines_of(cur), *sweeps_of(cur), *PROPOSING,
        least_explained, 16, 4, 4, *ARGS,
    )  # fmt: skip


@pytest.mark.parametrize("off", [Pose.identity(), Pose(0.6, -0.4, 0.5)])
@pytest.mark.parametrize("step", [1, 3])
def test_free_space_between_places(
    half_turn_stretches: list[Stretch], off: Pose, step: int
) -> None:
    s = half_turn_stretches[1]
    T = s.forth.T_world_anchor.between(s.back.T_world_anchor) @ off
    ref, cur, counts = s.forth.place, s.back.place, np.empty(4)
    judge_places(*sweeps_of(ref), *sweeps_of(cur), T.to_array(), step, *ARGS, counts)
    expected = slow.judge_places(ref, cur, T.to_array(), step, *ARGS)
    assert expected.sum() == len(ref.surface.points[::step]) + len(cur.surface.points[::step])
    np.testing.assert_allclose(counts, expected, atol=1)  # a point at the border of two beams
    assert expected[_free_space_kernels.MATCHED] > 10
    if off.x and step == 1:
        assert expected[_free_space_kernels.CONFLICT] > 20
        assert count_points(ref, cur, T) == (counts[0], counts[1])


def test_the_cascade_is_its_steps_one_after_the_other(half_turn_stretches: list[Stretch]) -> None:
    for s in half_turn_stretches[:2]:
        ref, cur = s.forth.place, s.back.place
        proposals = propose(*lines_of(ref), *lines_of(cur), *PROPOSING)
        expected = slow.cascade(ref, cur, proposals, 16, 4, 4, ARGS)
        table = matched(ref, cur, 0.0)
        assert len(expected) >= 2
        np.testing.assert_allclose(table[:, :5], expected[:, :5], atol=1e-9)
        np.testing.assert_allclose(table[:, 5:9], expected[:, 5:9], atol=4)
        np.testing.assert_allclose(table[:, 9], expected[:, 9], atol=1e-9)


def test_nothing_dear_is_tried_where_too_little_is_explained(
    half_turn_stretches: list[Stretch],
) -> None:
    s = half_turn_stretches[0]
    table = matched(s.forth.place, s.again.place, 0.0)
    most = propose(*lines_of(s.forth.place), *lines_of(s.again.place), *PROPOSING)[0, 3]
    assert len(table) > 0
    np.testing.assert_array_equal(matched(s.forth.place, s.again.place, most - 1e-6), table)
    assert len(matched(s.forth.place, s.again.place, most + 1e-6)) == 0


def test_evidence_counts_lines_and_cells_and_punishes_conflict() -> None:
    assert fast.place_evidence(120.0, 10.0, 7.5) == pytest.approx(7.5 + 12.0 - 3.0)
    row = np.array([0, 0, 0, 0, 0, 120.0, 10.0, 0, 0, 7.5])
    assert slow.evidence(row) == pytest.approx(fast.place_evidence(120.0, 10.0, 7.5))


@pytest.mark.parametrize("off", [Pose.identity(), Pose(0.6, -0.4, 0.5)])
def test_tally_of_sweeps(half_turn_stretches: list[Stretch], off: Pose) -> None:
    s = half_turn_stretches[0]
    T = s.forth.T_world_anchor.between(s.back.T_world_anchor) @ off
    ref, points = s.forth.place, s.back.place.surface.points[::5]
    out = np.empty((len(points), 2))
    tally_sweeps(
        points, T.to_array(), ref.ranges, ref.angle_mins, ref.angle_increments, ref.sweep_poses,
        *ARGS, out,
    )  # fmt: skip
    expected = slow.tally(ref, points, T, ARGS)
    # A point at the border of two beams may fall to either.
    assert np.mean(np.any(out != expected, axis=1)) < 0.03
    assert np.count_nonzero(expected) > 10


def test_what_stands_still_is_steady_and_found_again(half_turn_stretches: list[Stretch]) -> None:
    s = half_turn_stretches[0]
    T = s.forth.T_world_anchor.between(s.back.T_world_anchor)
    ref, cur = s.forth.place, s.back.place
    assert ref.steady.mean() > 0.7
    matched, missing = count_steady(ref, cur, T)
    assert matched > 100
    assert missing <= 0.02 * matched
    assert count_steady(cur, ref, T.inverse()) == (matched, missing)
    moved, gone = count_steady(ref, cur, T @ Pose(0.6, -0.4, 0.5))
    assert gone > 5 * max(missing, 1)
    assert moved < matched
