"""The scans of a component's keyframes as rays, where the graph has them now."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lineloom_core.fusion.occupancy import Rays
from lineloom_core.mapping.belief.site_map import SiteMap


def component_rays(site: SiteMap, component: str) -> Rays:
    """Return the rays of all keyframes of a component, in its map frame; none if there is none."""
    return rays_of(site, [k for k in sorted(site.keyframes) if site.component_id(k) == component])


def rays_of(site: SiteMap, members: Sequence[int]) -> Rays:
    """Return the rays of keyframes of one component, in its map frame and in the order given."""
    scans = [site.keyframes[k].scan for k in members]
    return Rays.of(
        [site.pose(k).to_array() for k in members],
        [(scan.angle_min, scan.angle_increment) for scan in scans],
        [np.asarray(scan.ranges) for scan in scans],
    )
