"""How much maps conflict in free space, and how much of that is usual for a robot.

A robot whose lidar is noisy, or that drives among chair legs, contradicts even itself a few metres
on, where it knows its way well: 8 to 14 % of the points for a Hokuyo in a cluttered room, 2 % for
MIT CSAIL's SICK, none in simulation. So much more may it contradict another robot's map.
"""

from __future__ import annotations

from collections.abc import Iterable

from lineloom_core.geometry import Pose
from lineloom_core.mapping.site_map import SiteMap
from lineloom_core.places import Place, count_points

_APART = 2  # places on: the next but one shares no keyframe


def conflict_between(pairs: Iterable[tuple[Place, Place, Pose]]) -> float:
    """Share of points in the other's free space, beyond the places' own, over all (a, b, T_a_b)."""
    matched = conflict = 0.0
    for a, b, T_a_b in pairs:
        m, c = count_points(a, b, T_a_b)
        matched += m
        conflict += max(c - (a.own_conflict + b.own_conflict) * (m + c), 0.0)
    return conflict / max(matched + conflict, 1.0)


def usual_conflict(site: SiteMap, places: Iterable[Place]) -> float:
    """What robots' own successive places, whose relative poses are known well, come to."""
    by_track: dict[str, list[Place]] = {}
    for place in places:
        by_track.setdefault(site.track(place.anchor).id, []).append(place)
    return conflict_between(
        (a, b, site.pose(a.anchor).between(site.pose(b.anchor)))
        for chain in by_track.values()
        for a, b in zip(chain, chain[_APART:], strict=False)
    )
