"""A robot carried elsewhere between two scans, into a place that looks alike.

Tracking follows walls, and equal rooms have the same: the scan after a kidnapping may fit the map
before it. What stands in the rooms differs. So the scan at which a robot jumped contradicts the
free space of the keyframe before, if not enough to be refused; and once the robot has driven on,
what stood still just before that step is gone after it, and what stands after it was not there
before. Whoever stood about and walked off is missing one way only.

Both sides of a step are held against each other whole. Places, which are made every few metres,
would straddle the jump: how much each shows of either side is chance, and so would be the verdict.
"""

from __future__ import annotations

import math

from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.place_making import make_place
from lineloom_core.mapping.belief.refusals import is_approved
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.belief.track import Track
from lineloom_core.mapping.merging.withdrawal import is_doubted, withdrawn
from lineloom_core.places import Place, count_steady_each_way, missing_share

_MEMBERS = 8  # keyframes on either side of a step that are held against each other
_LEAST_BEFORE = 4
_LONG, _A_DOOR = 0.6, 10
"""From so long a step [m] on, points (cells of 0.1 m) gone each way that say nothing: the two scans
see round other corners, and a door on the way was opened."""
_BESIDE = 2  # steps on either side that a suspect stands out from


def jump(site: SiteMap, place: Place) -> Constraint | None:
    """The step at which a track jumped, if what was driven up to `place` says so."""
    config = site.config.doubt
    track = site.track(place.anchor)
    for at in _suspects(site, track, place):
        ways = _each_way(site, track, at)
        if min(map(sum, ways)) < config.jump_points:
            continue
        doors = _A_DOOR if _is_long(site, track, at) else 0
        gone = ((seen, max(missing - doors, 0)) for seen, missing in ways)
        share = math.sqrt(math.prod(missing_share(*way) for way in gone))
        if is_doubted(site, {"jump_missing": share}):
            step = site.constraints[site.id_of("step", track.keyframes[at])]
            return withdrawn(site, step, {"jump_missing": share})
    return None


def _suspects(site: SiteMap, track: Track, place: Place) -> list[int]:
    """Positions of steps that contradict the keyframe before, more than those beside them do.

    Of all that now have enough keyframes after them, and had not when the last place was made:
    each step is judged once.
    """
    earlier = [p for p in track.places if p < place.id]
    begin = track.position(earlier[-1]) + 1 if earlier else 0
    end = track.position(place.id) + 1
    found = []
    for at in range(max(begin - _MEMBERS + 1, _LEAST_BEFORE), end - _MEMBERS + 1):
        around = [_conflict(site, k) for k in track.keyframes[at - _BESIDE : at + _BESIDE + 1]]
        conflict = around[_BESIDE]
        if conflict >= site.config.doubt.jump_conflict and conflict == max(around):
            found.append(at)
    return found


def _is_long(site: SiteMap, track: Track, at: int) -> bool:
    step = site.step(track.keyframes[at])
    return step is not None and math.hypot(step.T_a_b.x, step.T_a_b.y) > _LONG


def _conflict(site: SiteMap, keyframe: int) -> float:
    """Share of a keyframe's scan that lies in what the one before saw as free, by its step."""
    step = site.step(keyframe)
    if step is None or is_approved(site, step):
        return 0.0
    return step.checks.get("conflict_share", 0.0)


def _each_way(site: SiteMap, track: Track, at: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """Steady points seen again across a step, and gone there: those after it, those before it."""
    before, after = (
        make_place(members, site.keyframes)
        for members in (
            track.keyframes[max(at - _MEMBERS, 0) : at],
            track.keyframes[at : at + _MEMBERS],
        )
    )
    T = site.keyframes[before.anchor].T_track_laser.between(
        site.keyframes[after.anchor].T_track_laser
    )
    return count_steady_each_way(before, after, T)
