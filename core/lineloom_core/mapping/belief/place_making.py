"""Making places of a track's last keyframes."""

from __future__ import annotations

import math
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


def place_is_due(track: Track, config: PlaceConfig, *, strayed: bool) -> bool:
    """Whether the robot has driven on far enough since its last place.

    strayed: it lost its track and has not been found again. Then smaller places will do until it
    has driven `span` metres: what comes after a break may be short.
    """
    driven = track.travelled[-1]
    first, stride = config.span, config.stride
    if strayed and driven < config.span:
        first = stride = 0.5 * config.stride
    return driven >= first and driven - track.last_place_at >= stride


def recent_keyframes(track: Track, config: PlaceConfig) -> list[int]:
    """The keyframes of the last `span` metres, thinned to at most `most_keyframes`."""
    return _up_to(track, len(track.keyframes), config)


def _up_to(track: Track, end: int, config: PlaceConfig) -> list[int]:
    start = track.travelled[end - 1] - config.span
    members = track.keyframes[bisect_left(track.travelled, start) : end]
    while len(members) > config.most_keyframes:
        members = members[::2]
    return members


def left_over(track: Track, config: PlaceConfig) -> list[list[int]]:
    """Keyframes of places that a track is worth which has ended, beside those made while it went.

    Those it would have got had its robot strayed before it, and one of its end.
    """
    half = 0.5 * config.stride
    marks = [k * half for k in range(1, math.ceil(config.span / half))]
    marks = [mark for mark in marks if mark < min(config.span, track.travelled[-1])]
    if track.travelled[-1] - track.last_place_at >= half:
        marks.append(track.travelled[-1])
    found = (_up_to(track, bisect_left(track.travelled, mark) + 1, config) for mark in marks)
    kept, made = set(track.kept), set(track.places)
    return [
        members
        for members in found
        if len(members) >= config.least_keyframes
        and members[-1] not in made
        and kept.issuperset(members)
    ]


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
