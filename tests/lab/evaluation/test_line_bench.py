"""The benchmark of lines: what counts as seen, as right, as a corner, and that it runs."""

from __future__ import annotations

import json

import numpy as np
import pytest
from lineloom.cli.app import app
from lineloom_lab.evaluation import line_bench_floors
from lineloom_lab.evaluation.line_bench import run_line_case
from lineloom_lab.evaluation.line_bench_floors import Floor
from lineloom_lab.evaluation.line_bench_judge import carried, judge_alone, judge_by_truth
from lineloom_lab.evaluation.line_bench_truth import TrueFaces, seen_faces
from lineloom_lab.simulation import rectangle, scanner_360
from numpy.typing import NDArray
from typer.testing import CliRunner

STANDING = np.array([[4.0, 2.5, 0.3], [3.5, 2.0, 0.0]])


@pytest.fixture(scope="module")
def room() -> TrueFaces:
    return seen_faces(rectangle(8.0, 5.0), scanner_360(), STANDING)


def _judged(lines: NDArray[np.float64], room: TrueFaces) -> dict[str, float]:
    figures = judge_by_truth(lines, lines, np.full(len(lines), 0.01), room)
    return {name: getattr(figures, name) for name in figures.__dataclass_fields__}


def test_a_room_is_seen_as_four_faces_and_corners(room: TrueFaces) -> None:
    assert len(room.faces) == 4
    lengths = np.hypot(*(room.faces[:, 2:] - room.faces[:, :2]).T)
    np.testing.assert_allclose(np.sort(lengths), [5, 5, 8, 8], atol=0.05)
    # The room lies on the left of each.
    middle = np.array([4.0, 2.5]) - room.faces[:, :2]
    along = room.faces[:, 2:] - room.faces[:, :2]
    assert (along[:, 0] * middle[:, 1] - along[:, 1] * middle[:, 0] > 0).all()
    corners = {tuple(c) for c in np.round(room.corners[:, :2], 2).tolist()}
    assert corners == {(0.0, 0.0), (8.0, 0.0), (8.0, 5.0), (0.0, 5.0)}


def test_a_wall_that_one_sweep_saw_is_not_seen() -> None:
    assert len(seen_faces(rectangle(8.0, 5.0), scanner_360(), STANDING[:1]).faces) == 0


def test_the_truth_itself_is_perfect(room: TrueFaces) -> None:
    world = rectangle(8.0, 5.0).walls
    told = _judged(world, room)
    assert (told["precision_3"], told["recall_3"], told["pieces"]) == (1.0, 1.0, 1.0)
    assert (told["corners"], told["false_lines"], told["twins"]) == (1.0, 0, 0.0)
    assert told["ends_met"] == 1.0


def test_what_is_wrong_is_told(room: TrueFaces) -> None:
    world = rectangle(8.0, 5.0).walls
    shifted = world + np.array([0.0, 0.04, 0.0, 0.04])  # the two long walls are 4 cm off
    told = _judged(shifted, room)
    assert told["precision_5"] > 0.98
    assert told["precision_3"] == pytest.approx(10 / 26, abs=0.02)
    assert told["recall_3"] == pytest.approx(10 / 26, abs=0.02)
    wrong_side = world[:, [2, 3, 0, 1]] + 0.2
    assert _judged(wrong_side, room)["recall_5"] < 0.05
    cut = np.vstack([world[1:], [0.0, 0.0, 3.0, 0.0], [3.1, 0.0, 8.0, 0.0]])
    assert _judged(cut, room)["pieces"] == pytest.approx(5 / 4)
    twin = np.vstack([world, [1.0, 0.1, 3.0, 0.1]])
    assert _judged(twin, room)["twins"] == pytest.approx(100 * 2 / 28)
    assert _judged(twin, room)["false_lines"] == 0
    across = np.vstack([world, [4.0, 1.0, 5.0, 2.0]])
    assert _judged(across, room)["false_lines"] == 1
    short = world + np.array([0.03, 0.0, 0.0, 0.0])
    assert _judged(short, room)["corners"] < 1.0


def test_lines_are_carried_as_the_keyframes_around_them_lie() -> None:
    """A map bent in the middle is right in each half, and wrong as a whole."""
    true = np.array([[x, 0.0, 0.0] for x in range(21)], dtype=float)
    mapped = true.copy()
    mapped[11:, 1] += 1.0
    line = np.array([[18.0, 2.0, 20.0, 2.0]])
    near, whole = (carried(line, mapped, true, near=local) for local in (True, False))
    np.testing.assert_allclose(near, line - [0, 1, 0, 1], atol=0.05)
    assert abs(whole[0, 1] - 1.0) > 0.3


def test_a_map_without_truth_is_judged_by_itself() -> None:
    lines = np.array([[0, 0, 5, 0], [5, 0.01, 5, 3], [7, 0, 7.3, 0], [1, 0.1, 4, 0.1]], dtype=float)
    told = judge_alone(lines)
    assert told.precision_5 is None
    assert told.short == pytest.approx(0.3 / told.metres)
    assert told.twins == pytest.approx(100 * 3 / told.metres)
    assert told.ends_met == pytest.approx(2 / 6)


def test_a_floor_gives_the_same_figures_every_time() -> None:
    floor = Floor("sparse", "flat", 1, duration_s=12.0)
    first, second = (run_line_case(floor) for _ in range(2))
    assert first == second
    assert first.half == "B"
    assert first.figures.precision_5 is not None
    assert first.figures.precision_5 > 0.8


def test_the_command_runs_the_cases_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    floors = [Floor("plain", "flat", 0, duration_s=8.0)]
    monkeypatch.setattr(line_bench_floors, "floors", lambda quick: floors)
    ran = CliRunner().invoke(app, ["bench", "lines", "--quick", "--json", "-"])
    assert ran.exit_code == 0, ran.output
    document = json.loads(ran.stdout)
    assert [row["case"] for row in document["rows"]] == ["plain, flat 0"]
    assert [row["half"] for row in document["halves"]] == ["A"]
    nothing = CliRunner().invoke(app, ["bench", "lines", "--quick", "--only", "castle"])
    assert nothing.exit_code == 2
    assert "plain, flat 0" in nothing.stderr
