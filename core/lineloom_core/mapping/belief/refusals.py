"""What is refused because a verdict stands against it.

An operator who retracts a meeting of two robots means the meeting, not the one pair of places:
everything that would put the two maps together in the same way is refused with it.
"""

from __future__ import annotations

import numpy as np

from lineloom_core.graph import CHI2_99, cycle_errors
from lineloom_core.mapping.belief.constraint import CONSTRAINT_FLOOR, Constraint, turned_round
from lineloom_core.mapping.belief.site_map import SiteMap

_SAYS_THE_SAME = 2.0 * CHI2_99
"""Squared cycle error up to which two recognitions tell one story; generous, as a verdict is."""


def refuse_barred(site: SiteMap, candidates: list[Constraint]) -> list[Constraint]:
    """Reject those candidates that say the same as one that is barred; return the others."""
    free = []
    for c in candidates:
        barred = _says_the_same_as(site, c)
        if barred is None:
            free.append(c)
            continue
        how = "retracted" if barred.id in site.verdicts.retracted else "withdrawn"
        stored = site.constraints[c.id]
        site.add_constraint(
            stored.moved_to("rejected", f"says the same as {barred.id}, which was {how}", site.now)
        )
    return free


def _says_the_same_as(site: SiteMap, c: Constraint) -> Constraint | None:
    for barred in site.verdicts.all_barred():
        if barred.place_a < 0 or any(
            not site.knows(k) for k in (barred.keyframe_a, barred.keyframe_b)
        ):
            continue
        for other in (barred, turned_round(barred)):
            if (
                site.same_component(other.keyframe_a, c.keyframe_a)
                and site.same_component(other.keyframe_b, c.keyframe_b)
                and _cycle_error(site, other, c) < _SAYS_THE_SAME
            ):
                return barred
    return None


def _cycle_error(site: SiteMap, c: Constraint, o: Constraint) -> float:
    pair = (c, o)
    d2 = cycle_errors(
        np.array([site.pose(k.keyframe_a).to_array() for k in pair]),
        np.array([site.pose(k.keyframe_b).to_array() for k in pair]),
        np.array([k.T_a_b.to_array() for k in pair]),
        np.broadcast_to(CONSTRAINT_FLOOR, (2, 3, 3)),
        lambda i, j: site.drift(pair[i].keyframe_a, pair[j].keyframe_a),
        lambda i, j: site.drift(pair[i].keyframe_b, pair[j].keyframe_b),
    )
    return float(d2[0, 1])
