"""A robot carried elsewhere between two scans, into a place that looks alike.

Tracking follows walls, and equal rooms have the same: the scan after a kidnapping may fit the map
before it. What stands in the rooms differs. So the places along one track are held against each
other, two on, where they still see the same: if what stood still is gone, twice running, the robot
has jumped in between, and the step at which it did so is named.
"""

from __future__ import annotations

from lineloom_core.mapping.belief.constraint import Constraint, step_id
from lineloom_core.mapping.belief.place_making import make_place
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.merging.overlap import Count, count_steady_nearby
from lineloom_core.places import Place, count_steady, missing_share

_MEMBERS = 8  # keyframes on either side of a step that are held against each other


def jump(site: SiteMap, place: Place) -> Constraint | None:
    """The step at which a track jumped, if its last four places, `place` the last, say so."""
    config = site.config.doubt
    track = site.track(place.anchor)
    last = _last_places(site, place)
    if len(last) < 4:
        return None
    counts = [_held_together(site, last[0], last[2]), _held_together(site, last[1], last[3])]
    matched, missing = (sum(c[i] for c in counts) for i in (0, 1))
    share = missing_share(matched, missing)
    if matched + missing < config.jump_points or share < config.jump_missing:
        return None
    if min(missing_share(*c) for c in counts) <= config.place_right:
        return None  # somebody stood in one of them
    steps = [
        k
        for k in track.keyframes
        if last[1].keyframes[0] < k <= last[2].keyframes[-1]
        and step_id(k) not in site.verdicts.approved
        and step_id(k) in site.constraints
    ]
    if not steps:
        return None
    worst = max(steps, key=lambda k: (_missing_across(site, k), -k))
    reason = f"withdrawn: the robot jumped here, {share:.1%} of what stood still is gone"
    return site.constraints[step_id(worst)].moved_to("retracted", reason, site.now)


def _last_places(site: SiteMap, place: Place) -> list[Place]:
    """The last four places of a track, oldest first."""
    track = site.track(place.anchor)
    numbers = [p for p in track.places if p <= place.id][-4:]
    return [site.places[p] for p in numbers]


def _held_together(site: SiteMap, before: Place, after: Place) -> Count:
    T = site.pose(before.anchor).between(site.pose(after.anchor))
    return count_steady_nearby(before, after, T)


def _missing_across(site: SiteMap, keyframe: int) -> float:
    """Share of what stood still that is gone from one side of a keyframe's step to the other."""
    track = site.track(keyframe)
    at = track.position(keyframe)
    before, after = (
        make_place(members, site.keyframes)
        for members in (
            track.keyframes[max(at - _MEMBERS, 0) : at],
            track.keyframes[at:][:_MEMBERS],
        )
    )
    T = site.keyframes[before.anchor].T_track_laser.between(
        site.keyframes[after.anchor].T_track_laser
    )
    return missing_share(*count_steady(before, after, T))
