"""When two constraints say the same, and when one is what a verdict of another replay is about.

An operator's verdict outlives the constraint that it was passed on: under other parameters or newer
code the same story rests on neighbouring keyframes. A verdict whose constraint is not there stands
(`standing`), and means

- a step: the one that leads over the scan it was to lead to;
- a loop of two near keyframes: those with ends less than `NEAR` from the named scans, along the
  way, that say the same;
- a recognition: all that say the same of the two maps, wherever.

What says the same is a matter of drift: two constraints and the ways between their ends close up.
"""

from __future__ import annotations

import numpy as np

from lineloom_core.graph import CHI2_99, cycle_errors
from lineloom_core.mapping.belief.constraint import CONSTRAINT_FLOOR, Constraint, turned_round
from lineloom_core.mapping.belief.site_map import SiteMap

NEAR = 1.25
"""Metres: half of what lies between two places, more than between two loops."""

_SAYS_THE_SAME = 2.0 * CHI2_99
"""Squared cycle error up to which two recognitions tell one story; generous, as a verdict is."""


def is_meant(site: SiteMap, standing: Constraint, c: Constraint) -> bool:
    """Whether a constraint is what a standing verdict is about."""
    if standing.claim is None or standing.origin != c.origin:
        return False
    if c.origin == "step":
        before, after = (site.keyframes[k].scan_name for k in (c.keyframe_a, c.keyframe_b))
        return standing.claim.scan_b.lies_between(before, after)
    return says_the_same(site, standing, c, within=2.0 * NEAR if c.origin == "near" else None)


def says_the_same(
    site: SiteMap, known: Constraint, c: Constraint, within: float | None = None
) -> bool:
    """Whether two constraints tie the same components together in the same way.

    within: how far along the way, in metres, their ends may lie from each other.
    """
    if any(not site.knows(k) for k in (known.keyframe_a, known.keyframe_b)):
        return False
    return any(
        _joined(site, other.keyframe_a, c.keyframe_a, within)
        and _joined(site, other.keyframe_b, c.keyframe_b, within)
        and _cycle_error(site, other, c) < _SAYS_THE_SAME
        for other in (known, turned_round(known))
    )


def _joined(site: SiteMap, a: int, b: int, within: float | None) -> bool:
    if within is None:
        return site.same_component(a, b)
    return site.same_track(a, b) and site.driven_between(a, b) <= within


def _cycle_error(site: SiteMap, c: Constraint, o: Constraint) -> float:
    pair = (c, o)
    ends = [k.keyframe_a for k in pair], [k.keyframe_b for k in pair]
    d2 = cycle_errors(
        np.array([site.pose(k.keyframe_a).to_array() for k in pair]),
        np.array([site.pose(k.keyframe_b).to_array() for k in pair]),
        np.array([k.T_a_b.to_array() for k in pair]),
        np.broadcast_to(CONSTRAINT_FLOOR, (2, 3, 3)),
        *(site.drifts(keyframes).among(keyframes) for keyframes in ends),
    )
    return float(d2[0, 1])
