"""What a service answered, against the truth: known answers give known figures."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching.thesis import Windows
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_lab.experiments.recording import Recording, closed_path
from lineloom_lab.experiments.served_path import Answered, ServedPath, lying_on
from lineloom_lab.experiments.served_report import served_report

T_MAP_WORLD = Pose(3.0, -2.0, 0.7)


@pytest.fixture(scope="module")
def recording() -> Recording:
    return closed_path(0, 23)


def served(recording: Recording, off: dict[int, float], parts: dict[int, str | None]) -> ServedPath:
    """True poses in a map of another frame; off: scans moved so far [m]; parts: not c-1."""
    components = tuple(parts.get(i, "c-1") for i in range(len(recording)))
    poses = tuple(
        None if c is None else T_MAP_WORLD @ Pose(p.x + off.get(i, 0.0), p.y, p.theta)
        for i, (c, p) in enumerate(zip(components, recording.poses, strict=True))
    )
    walls = T_MAP_WORLD.transform(recording.world.walls.reshape(-1, 2)).reshape(-1, 4)
    answered = Answered(components, poses, {"c-1": walls}, 2.3)
    return ServedPath("thesis", "thesis's matcher", "#d55e00", recording, answered)


def test_the_truth_in_another_frame_has_no_error(recording: Recording) -> None:
    f = served(recording, {}, {}).figures()
    assert (f["components"], f["placed"], f["in_largest"]) == (1, 23, 23)
    assert max(f["error_from_first_max"], f["error_max"], f["rotation_from_first_max"]) < 1e-9
    assert f["map_length"] == pytest.approx(14.0)
    assert f["map_width"] == pytest.approx(7.0)
    assert f["seconds_per_scan"] == pytest.approx(0.1)
    assert 0.0 < f["error_area_percentage_median"] < 1.0


def test_errors_are_those_of_the_largest_component(recording: Recording) -> None:
    run = served(recording, {7: 0.2, 20: 9.0}, {3: None, 19: "c-2", 20: "c-2"})
    f = run.figures()
    assert (f["components"], f["placed"], f["in_largest"]) == (2, 22, 20)
    assert f["error_from_first_max"] == pytest.approx(0.2)
    assert f["error_from_first_mean"] == pytest.approx(0.2 / 20)
    assert 0.15 < f["error_max"] < 0.2
    right = served(recording, {}, {}).figures()
    assert f["error_area_percentage_mean"] > right["error_area_percentage_mean"]
    # 3 lies between two pairs, and 18 to 21 hold three of which none is within the component.
    assert len(run.percentages) == 22 - 2 - 3


def test_where_no_scan_has_a_place_there_is_no_error(recording: Recording) -> None:
    run = served(recording, {}, dict.fromkeys(range(23)))
    assert run.figures().keys() == {
        *("scans", "placed", "components", "in_largest", "seconds_per_scan")
    }
    report = served_report("sparse-path", 0, [run])
    assert "| components " in report.to_markdown()
    assert report.to_json()["series"] == {"thesis": {}}


def test_the_report_has_the_text_s_figures_beside_both(recording: Recording) -> None:
    report = served_report("sparse-path", 0, [served(recording, {7: 0.2}, {})] * 2)
    printed = {row["what"]: row["printed"] for row in report.to_json()["table"]}
    assert printed["size of the map"] == "14 m x 7 m"
    assert printed["time a scan, from POST to idle"] == "3.48 ms a pair"
    assert printed["distance travelled"] == "43.19 m"
    (row,) = [r for r in report.rows if r.what.startswith("error of the position, from S_0")]
    assert row.cells == ("20.0 / 0.9 cm", "20.0 / 0.9 cm")


def test_lines_are_paired_where_they_lie_on_each_other() -> None:
    x, y = 2.0 * math.sin(math.radians(4.0)), 2.0 * math.cos(math.radians(4.0))
    r = LineSegments.of(np.array([[0, 0, 4, 0], [4, 0, 4, 3], [5, 0.05, 9, 0.05]]))
    c = np.array(
        [
            [1.0, 0.05, 3.0, 0.05],  # on the first
            [4.0, 1.0, 4.0 - x, 1.0 + y],  # turned within the window
            [3.0, 0.0, 1.0, 0.0],  # faces the other way
            [1.0, 0.15, 3.0, 0.15],  # beside it
            [3.5, 0.02, 8.0, 0.02],  # on two: the one it shares more with
            [10.0, 0.0, 12.0, 0.0],  # beyond
        ]
    )
    assert lying_on(r, LineSegments.of(c), Windows()) == [(0, 0), (1, 1), (2, 4)]
    assert lying_on(r, LineSegments.of(np.zeros((0, 4))), Windows()) == []
