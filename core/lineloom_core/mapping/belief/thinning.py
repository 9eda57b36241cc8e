"""Letting go of what is known well: a map grows with its building, not with the hours driven.

Steps of `thin`: 1. find the places that show what the new one shows: near it, looking the same
way; 2. of more than `most_alike`, choose those to let go: neither the oldest, which says since when
things stand there, nor the latest, which say how they stand now; 3. take them out of recognition,
and their keyframes out of the graph and out of the fused lines, unless another place needs them.

A meeting of two maps is never let go, nor are the places that it was seen in, and neither are the
ends of what was retracted or withdrawn, nor the keyframe that a component is named after. The
history keeps all keyframes, so that what is undone is undone as if it had never been believed.
Poses of what was let go stay known to the trajectory.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby

from lineloom_core.geometry import angle_difference
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.belief.track import Track
from lineloom_core.places import Place


def thin(site: SiteMap, place: Place) -> tuple[Place, ...]:
    """Let go of what the new place and others before it show as well; return those places."""
    alike = _alike(site, place)
    surplus = len(alike) - site.config.thinning.most_alike
    if surplus <= 0:
        return ()
    gone = [p for p in alike[1:] if _may_go(site, p)][:surplus]
    for p in gone:
        del site.places[p.id]
        site.memory.let_go(p.id)
    if gone:
        site.let_go(_unneeded(site, gone))
        site.tidy()
    return tuple(gone)


def _alike(site: SiteMap, place: Place) -> list[Place]:
    """Step 1; the oldest first, the new one included."""
    config, heading = site.config.thinning, site.pose(place.anchor).theta
    return [
        p
        for p in site.places_around(place.anchor, config.radius)
        if abs(angle_difference(site.pose(p.anchor).theta, heading)) <= config.angle
    ]


def _may_go(site: SiteMap, place: Place) -> bool:
    """Step 2: whether nothing rests on a place and its robot has driven on."""
    track = site.track(place.anchor)
    driven = track.travelled[-1] - track.travelled[track.position(place.id)]
    if site.is_latest(track) and driven < site.config.thinning.apart:
        return False
    return not any(_holds_something(site, k) for k in place.keyframes)


def _holds_something(site: SiteMap, keyframe: int) -> bool:
    """Whether a meeting rests on a keyframe, or a verdict, which somebody may look at again."""
    if any(edge.kind in ("rendezvous", "operator") for edge in site.graph.edges_at(keyframe)):
        return True
    return any(keyframe in (c.keyframe_a, c.keyframe_b) for c in site.verdicts.all_told())


def _unneeded(site: SiteMap, gone: list[Place]) -> list[list[int]]:
    """Step 3: runs of keyframes along these places that lie along no other, and hold nothing."""
    tracks = {site.track(p.anchor).id: site.track(p.anchor) for p in gone}
    root = site.component_root(gone[0].anchor)
    runs: list[list[int]] = []
    for track in tracks.values():
        stretches = [
            (p.keyframes[0], p.keyframes[-1])
            for p in site.places.values()
            if site.track(p.anchor) is track
        ]
        along = {
            k
            for p in gone
            if site.track(p.anchor) is track
            for k in track.between(p.keyframes[0], p.keyframes[-1])
        }
        unneeded = (
            k
            for k in sorted(along - {root})
            if not any(first <= k <= last for first, last in stretches)
            and not _holds_something(site, k)
        )
        runs.extend(_runs(track, unneeded))
    return runs


def _runs(track: Track, keyframes: Iterable[int]) -> list[list[int]]:
    """Cut into pieces without a kept keyframe in between."""
    numbered = ((k, track.kept_position(k) - i) for i, k in enumerate(keyframes))
    return [[k for k, _ in run] for _, run in groupby(numbered, key=lambda pair: pair[1])]
