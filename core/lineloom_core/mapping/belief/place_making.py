"""Making places of a track's last keyframes."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from typing import Protocol

from lineloom_core.mapping.belief.track import Track
from lineloom_core.mapping.config import PlaceConfig
from lineloom_core.mapping.facts.keyframe import Keyframe
from lineloom_core.places import Glimpse, Place


class Keyframes(Protocol):
    """Keyframes by id: those of the map, or the history."""

    def __getitem__(self, keyframe: int, /) -> Keyframe:
        """The keyframe of this id."""


def place_is_due(track: Track, config: PlaceConfig) -> bool:
    """Whether the robot has driven on far enough since its last place."""
    driven = track.travelled[-1]
    return driven >= config.span and driven - track.last_place_at >= config.stride


def recent_keyframes(track: Track, config: PlaceConfig) -> list[int]:
    """The keyframes of the last `span` metres, thinned to at most `most_keyframes`."""
    start = track.travelled[-1] - config.span
    members = track.keyframes[bisect_left(track.travelled, start) :]
    while len(members) > config.most_keyframes:
        members = members[::2]
    return members


def make_place(members: Sequence[int], keyframes: Keyframes) -> Place:
    """The place that consecutive keyframes of one track show, anchored at the middle one.

    A function of the keyframes alone, so that a snapshot need not hold places. Its id is that of
    its last keyframe: the same however often the history is gone through.
    """
    anchor = keyframes[members[len(members) // 2]]
    frames = [keyframes[k] for k in members]
    glimpses = tuple(
        Glimpse(f.id, f, anchor.T_track_laser.between(f.T_track_laser)) for f in frames
    )
    return Place(members[-1], anchor.track, anchor.id, glimpses)
