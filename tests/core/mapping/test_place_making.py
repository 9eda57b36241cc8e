"""When places are made of a track, and what is made of one that has ended."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.place_making import left_over, place_is_due, recent_keyframes
from lineloom_core.mapping.belief.track import Track
from lineloom_core.mapping.config import PlaceConfig

CONFIG = PlaceConfig()
STEP = 0.25


def driven(way: float) -> Track:
    """A track of a keyframe every STEP metres, with the places that it got on its way."""
    track = Track("0", "ada")
    for k in range(round(way / STEP) + 1):
        track.append(k, Pose(STEP if k else 0.0, 0.0, 0.0), 1e-4 * np.eye(3))
        if place_is_due(track, CONFIG, strayed=False):
            track.last_place_at = track.travelled[-1]
            track.places.append(recent_keyframes(track, CONFIG)[-1])
    return track


def marks(track: Track, *, strayed: bool) -> list[float]:
    """Where places are made [m]."""
    so_far, found = Track("1", "ada"), []
    for k in track.keyframes:
        so_far.append(k, Pose(STEP if k else 0.0, 0.0, 0.0), 1e-4 * np.eye(3))
        if place_is_due(so_far, CONFIG, strayed=strayed):
            so_far.last_place_at = so_far.travelled[-1]
            found.append(so_far.travelled[-1])
    return found


def test_places_begin_when_a_whole_one_was_driven() -> None:
    assert marks(driven(10.0), strayed=False) == [5.0, 7.5, 10.0]


def test_who_has_strayed_is_looked_for_sooner() -> None:
    assert marks(driven(10.0), strayed=True) == [1.25, 2.5, 3.75, 6.25, 8.75]


@pytest.mark.parametrize(
    ("way", "ends"),
    [
        (0.5, []),  # three keyframes make no place
        (1.0, []),  # less than half a stride
        (2.0, [1.25, 2.0]),
        # The third has more keyframes than a place may: every other is left out, its last as well.
        (6.0, [1.25, 2.5, 3.5]),
        (9.0, [1.25, 2.5, 3.5, 9.0]),
    ],
)
def test_a_track_that_ended_leaves_what_it_would_have_got(way: float, ends: list[float]) -> None:
    track = driven(way)
    found = [track.travelled[members[-1]] for members in left_over(track, CONFIG)]
    assert found == ends
    for members in left_over(track, CONFIG):
        assert members == sorted(members)
        assert CONFIG.least_keyframes <= len(members) <= CONFIG.most_keyframes
        assert track.travelled[members[-1]] - track.travelled[members[0]] <= CONFIG.span


def test_what_is_made_already_or_was_let_go_is_left_out() -> None:
    track = driven(6.0)
    first, second, third = left_over(track, CONFIG)
    track.places = sorted([*track.places, second[-1]])
    assert left_over(track, CONFIG) == [first, third]
    track.kept.remove(first[0])
    assert left_over(track, CONFIG) == []
