"""All that the map knows around a pose, as one place: from any robot and any time."""

from __future__ import annotations

from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.places import Glimpse, Place

_APART_M, _APART_RAD = 0.3, 0.5  # a keyframe nearer than both to a chosen one adds nothing


def surroundings(
    site: SiteMap, member: int, here: Pose, *, radius: float, most: int
) -> tuple[Place, Pose]:
    """The keyframes around `here` in the component of keyframe `member`; and T_map_place.

    Nearest first, at most `most` of them, within `radius` m; `member` itself if there is none.
    """
    chosen: list[int] = []
    near = [k for k, _ in site.nearby(member, radius + site.pose(member).distance(here))]
    near = sorted([member, *near], key=lambda k: (site.pose(k).distance(here), k))
    for k in near:
        if len(chosen) == most or (chosen and site.pose(k).distance(here) > radius):
            break
        if all(_adds(site.pose(k), site.pose(c)) for c in chosen):
            chosen.append(k)
    anchor = site.pose(chosen[0])
    glimpses = tuple(Glimpse(k, site.keyframes[k], anchor.between(site.pose(k))) for k in chosen)
    return Place(-1, -1, chosen[0], glimpses), anchor


def _adds(pose: Pose, other: Pose) -> bool:
    turned = abs(angle_difference(pose.theta, other.theta))
    return pose.distance(other) > _APART_M or turned > _APART_RAD
