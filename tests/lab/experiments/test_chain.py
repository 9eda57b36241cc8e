"""A path and a map from scans alone, on a part of the closed path."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_lab.experiments.chain import Chain, match_chain
from lineloom_lab.experiments.contestant import (
    Contestant,
    default_contestant,
    thesis_contestant,
)
from lineloom_lab.experiments.path_errors import path_errors
from lineloom_lab.experiments.recording import Recording, closed_path


@pytest.fixture(scope="module")
def recording() -> Recording:
    return closed_path(0, 3069, 0.02)


@pytest.fixture(scope="module", params=["thesis", "default"])
def contestant(request: pytest.FixtureRequest) -> Contestant:
    return thesis_contestant() if request.param == "thesis" else default_contestant()


@pytest.fixture(scope="module")
def chain(contestant: Contestant, recording: Recording) -> Chain:
    return match_chain(contestant, recording.scans, recording.poses[0])


def test_the_path_follows_the_true_one(chain: Chain, recording: Recording) -> None:
    errors = path_errors(chain.poses, recording.poses)
    assert errors.right() == len(recording) - 1
    assert errors.global_translation.max() < 0.25
    assert np.degrees(errors.global_rotation.max()) < 2.0


def test_the_map_lies_on_the_walls(chain: Chain, recording: Recording) -> None:
    ends = chain.map_segments().reshape(-1, 2)
    assert 8 <= len(chain.line_map) <= 40
    off = [recording.world.clearance(x, y) for x, y in ends.tolist()]
    assert np.median(off) < 0.1


def test_error_areas_are_small_where_the_match_is_right(chain: Chain) -> None:
    assert chain.unanswered == 0
    assert np.isfinite(chain.percentages).all()
    assert 0.0 < np.median(chain.percentages) < 1.0


def test_where_there_is_no_answer_the_path_stands_still(recording: Recording) -> None:
    blind = recording.scans[0]
    object_free = type(blind).checked(
        np.full(len(blind), np.inf),
        angle_min=blind.angle_min,
        angle_increment=blind.angle_increment,
        range_min=blind.range_min,
        range_max=blind.range_max,
        stamp=0.0,
    )
    start = recording.poses[0]
    found = match_chain(default_contestant(), [blind, object_free, blind], start)
    assert found.poses == (start, start, start)
    assert found.unanswered == 2
    assert np.isnan(found.percentages).all()
