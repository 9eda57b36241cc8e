"""The judge of mapped logs, on trajectories whose marks are known by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_lab.evaluation.log_bench_judge import PlacedRobot, judge
from lineloom_lab.evaluation.log_bench_steps import BadStep, broken_steps, step_figures, wrong_steps
from numpy.typing import NDArray

Array = NDArray[np.float64]


def straight(count: int, step: float = 1.0) -> Array:
    """A robot that drives along x."""
    return np.column_stack([step * np.arange(count), np.zeros(count), np.zeros(count)])


def turned(poses: Array, x: float, y: float, theta: float) -> Array:
    """The same way in another frame: no reference's frame is the map's."""
    c, s = math.cos(theta), math.sin(theta)
    return np.column_stack(
        [
            x + c * poses[:, 0] - s * poses[:, 1],
            y + s * poses[:, 0] + c * poses[:, 1],
            poses[:, 2] + theta,
        ]
    )


def robot(
    poses: Array, reference: Array, component: str | list[str] = "a", name: str = "r"
) -> PlacedRobot:
    names = [component] * len(poses) if isinstance(component, str) else component
    return PlacedRobot(name, poses, np.array(names), reference)


def nowhere(poses: Array, rows: list[int]) -> Array:
    lost = poses.copy()
    lost[rows] = np.nan
    return lost


def test_a_map_that_is_right_in_another_frame_has_no_fault() -> None:
    truth = np.vstack([straight(20), np.column_stack([np.full(9, 19.0), 1.0 + np.arange(9.0),
                                                      np.full(9, math.pi / 2)])])  # fmt: skip
    figures = judge([robot(turned(truth, 3.0, -7.0, 2.5), truth)])
    assert figures.ate_rmse == pytest.approx(0.0, abs=1e-9)
    assert figures.ate_max == pytest.approx(0.0, abs=1e-9)
    assert (figures.components, figures.share_in_largest, figures.share_unplaced) == (1, 1.0, 0.0)
    assert (figures.wrong, figures.relations_wrong) == (0, 0)
    # 28 + 27 + 25 + 21 + 13 relations of 1, 2, 4, 8 and 16 steps.
    assert figures.relations == 114
    assert figures.share_agreeing == 1.0


def test_the_error_is_what_is_left_after_alignment() -> None:
    """Two ways of one length, one of them 0.6 m aside: half of it is taken up by each."""
    truth = np.vstack([straight(10), turned(straight(10), 0.0, 5.0, 0.0)])
    poses = truth.copy()
    poses[10:, 1] += 0.6
    figures = judge([robot(poses, truth)])
    assert figures.ate_rmse == pytest.approx(0.3)
    assert figures.ate_max == pytest.approx(0.3)


def test_scans_without_a_place_and_small_pieces_count_against_the_largest() -> None:
    truth = straight(10)
    poses = nowhere(truth, [4, 5])
    names = ["a"] * 4 + ["", ""] + ["b"] * 3 + ["c"]
    figures = judge([robot(poses, truth, names)])
    assert (figures.scans, figures.unplaced, figures.components) == (10, 2, 3)
    assert figures.share_in_largest == pytest.approx(0.4)
    # Within a: 3 of one step, 2 of two. Within b: 2 and 1. Rows next to each other among the placed
    # ones are related, so nothing ties a to b.
    assert figures.relations == 8


def test_scans_without_a_reference_neither_help_nor_harm() -> None:
    truth = nowhere(straight(10), [0, 1, 2, 3])
    figures = judge([robot(straight(10), truth, ["b"] * 4 + ["a"] * 6)])
    assert (figures.known, figures.largest, figures.components) == (6, 6, 1)
    assert figures.scans == 10


def test_a_slip_is_wrong_for_the_pose_and_for_the_relations_across_it() -> None:
    """From scan 20 of 40 on, the map lags 3 m behind: aligned, both halves are 1.5 m off."""
    truth = straight(40, 0.5)
    poses = truth.copy()
    poses[20:, 0] -= 3.0
    figures = judge([robot(poses, truth)])
    assert figures.wrong == 40
    assert figures.share_wrong == 1.0
    # The slip lies within 1, 2, 4, 8 and 16 relations of so many steps; 39 + 38 + 36 + 32 + 24.
    assert (figures.relations_wrong, figures.relations) == (31, 169)


def test_a_slip_of_less_than_a_metre_is_not_wrong() -> None:
    truth = straight(40, 0.5)
    poses = truth.copy()
    poses[20:, 0] -= 0.95
    figures = judge([robot(poses, truth)])
    assert (figures.wrong, figures.relations_wrong) == (0, 0)


def test_relations_reach_twenty_metres_of_way() -> None:
    truth = straight(20, 5.0)
    figures = judge([robot(truth, truth)])
    assert figures.relations == 19 + 18 + 16  # four steps are 20 m, eight are 40 m
    poses = truth.copy()
    poses[:, 0] *= 1.06  # 5 % and a little: 4 steps are 1.2 m too long, 2 steps 0.6 m
    assert judge([robot(poses, truth)]).relations_wrong == 16


def test_relations_are_a_robots_own() -> None:
    truth = straight(6)
    pair = [robot(truth, truth, name="r"), robot(turned(truth, 0.0, 2.0, 0.0), truth, name="s")]
    figures = judge(pair)
    assert figures.relations == 2 * (5 + 4 + 2)
    assert figures.relations_wrong == 0
    assert (figures.robots, figures.in_largest) == (2, 2)
    assert figures.wrong == 0  # 1 m each after alignment, and no more


def test_pieces_are_aligned_each_by_itself() -> None:
    truth = straight(12)
    poses = truth.copy()
    poses[6:] = turned(truth[6:], 50.0, 9.0, 1.0)
    figures = judge([robot(poses, truth, ["a"] * 6 + ["b"] * 6)])
    assert (figures.wrong, figures.components) == (0, 2)


def test_single_scans_are_pieces_without_error() -> None:
    truth = straight(5)
    figures = judge([robot(truth, truth, list("abcde"))])
    assert (figures.components, figures.largest, figures.wrong) == (5, 1, 0)
    assert figures.ate_rmse == pytest.approx(0.0)
    assert figures.relations == 0


def test_robots_apart_are_not_in_the_largest() -> None:
    truth = straight(6)
    figures = judge([robot(truth, truth, "a"), robot(truth[:4], truth[:4], "b")])
    assert (figures.robots, figures.in_largest) == (2, 1)
    assert figures.share_in_largest == pytest.approx(0.6)


def test_nothing_placed_is_no_error() -> None:
    truth = straight(4)
    figures = judge([robot(np.full((4, 3), np.nan), truth, "")])
    assert (figures.components, figures.share_in_largest, figures.share_unplaced) == (0, 0.0, 1.0)
    assert figures.ate_rmse is None


def test_without_any_reference_all_scans_count_and_nothing_is_judged() -> None:
    blind = robot(straight(4), np.full((4, 3), np.nan), ["a", "a", "a", "b"])
    figures = judge([blind])
    assert (figures.known, figures.largest, figures.components) == (4, 3, 2)
    assert (figures.ate_rmse, figures.agreeing, figures.compared) == (None, None, 0)
    assert figures.relations == 0
    assert step_figures([blind]).share_right is None


def test_agreement_needs_place_and_heading() -> None:
    truth = straight(100)
    poses = truth.copy()
    poses[10, 1] += 0.5
    poses[20, 2] += math.radians(7.0)
    poses[30, 1] += 0.3
    poses[40, 2] -= math.radians(5.0)
    figures = judge([robot(turned(poses, 1.0, 2.0, -0.7), truth)])
    assert figures.agreeing == 98


def test_a_robot_that_turns_on_the_spot_is_aligned_by_its_headings() -> None:
    truth = np.column_stack([np.zeros(36), np.zeros(36), np.radians(10.0 * np.arange(36))])
    rng = np.random.default_rng(3)
    poses = turned(truth, 4.0, 4.0, 1.3) + rng.normal(0.0, [0.01, 0.01, 0.005], (36, 3))
    assert judge([robot(poses, truth)]).share_agreeing == 1.0
    poses[18:, 2] += math.radians(14.0)  # half of it is taken up by each half
    assert judge([robot(poses, truth)]).agreeing == 0


def test_steps_are_counted_within_a_component() -> None:
    truth = straight(10)
    poses = nowhere(truth, [7])
    poses[3:, 0] += 0.4  # one step is 0.4 m too long
    poses[5:, 2] += math.radians(6.0)  # and one turns 6 degrees too far
    names = ["a"] * 7 + ["", "b", "b"]
    found = step_figures([robot(poses, truth, names)])
    assert (found.steps, found.wrong, found.breaks) == (7, 2, 2)
    assert [step.index for step in wrong_steps([robot(poses, truth, names)])] == [2, 4]
    assert [step.index for step in broken_steps([robot(poses, truth, names)])] == [6, 7]


def test_steps_that_are_right_are_not_among_the_worst() -> None:
    truth = straight(5)
    assert wrong_steps([robot(truth, truth)]) == []
    assert broken_steps([robot(truth, truth)]) == []
    jumped = truth.copy()
    jumped[2:, 1] += 2.0
    assert wrong_steps([robot(truth, truth), robot(jumped, truth)]) == [
        BadStep(1, 1, pytest.approx(2.0), pytest.approx(0.0))  # type: ignore[arg-type]
    ]
