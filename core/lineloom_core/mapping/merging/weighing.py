"""What is measured of a set of candidates, and how probable it makes it that the set is false."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import islice

import numpy as np

from lineloom_core.check import Check
from lineloom_core.checks import JOINED
from lineloom_core.geometry import Pose
from lineloom_core.join_odds import WEIGHTS, at_best
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.merging.distinctive import is_distinctive
from lineloom_core.mapping.merging.overlap import overlap_of_sets

_DISTINCTIVE_COUNTED = 2
_GROWING = {"set_size", "set_places", "known_places", "set_evidence", "set_seen"}
_MOST_MORE = 4.0  # times what is had: more than that nobody waits for
_MORE_STEP = 0.01


def figures_at_once(
    site: SiteMap, chosen: list[Constraint], rival: list[Constraint]
) -> dict[str, float]:
    """What is had of a set at once; every one of its constraints will show it."""
    places = {c.place_a for c in chosen}, {c.place_b for c in chosen}
    ends = chosen[0].keyframe_a, chosen[0].keyframe_b
    return {
        "set_size": float(len(chosen)),
        "set_places": float(min(map(len, places))),
        "known_places": float(min(map(site.places_in_component, ends))),
        "set_evidence": float(sum(c.evidence for c in chosen)),
        "set_margin": float(np.mean([c.checks["margin"] for c in chosen])),
        "rival_evidence": float(sum(c.evidence for c in rival)),
        "kin": float(site.are_kin(*ends)),
    }


def figures_of_maps(
    site: SiteMap, chosen: list[Constraint], poses: Mapping[int, Pose]
) -> dict[str, float]:
    """What takes long to have of a set. poses: of all keyframes of both, as if it were believed."""
    distinctive = float(_distinctive(site, chosen))
    return {"set_distinctive": distinctive, **overlap_of_sets(site, chosen, poses)}


def _distinctive(site: SiteMap, chosen: list[Constraint]) -> int:
    """How many of a set stand out, counted up to what counts.

    Those with most evidence are asked first: each is held against all places of its own maps, a
    thousand of which take seconds.
    """
    found = (
        c for c in sorted(chosen, key=lambda c: (-c.evidence, c.id)) if is_distinctive(site, c)
    )
    return sum(1 for _ in islice(found, _DISTINCTIVE_COUNTED))


def lacking(most_false: float, figures: Mapping[str, float]) -> str:
    """What a set lacks that may be false with more than `most_false`, in words.

    More of the same, if that alone would do: evidence, constraints, places and points all grow with
    the way that both have in common. Else that by which most could be gained.
    """
    low, high = 1.0, _MOST_MORE
    if at_best(_more_of(figures, high)) > most_false:
        worst = max(JOINED.rows, key=lambda row: _to_gain(row, figures))
        return worst.objection.format(figures[worst.name])
    while high - low > _MORE_STEP:
        middle = 0.5 * (low + high)
        if at_best(_more_of(figures, middle)) > most_false:
            low = middle
        else:
            high = middle
    metres = (high - 1.0) * figures["set_evidence"]
    return f"{math.ceil(metres)} m more of common wall"


def _more_of(figures: Mapping[str, float], times: float) -> dict[str, float]:
    return {k: v * times if k in _GROWING else v for k, v in figures.items()}


def _to_gain(row: Check, figures: Mapping[str, float]) -> float:
    """How much less would be added if the figure were at its best."""
    if not (row.weighed and row.objection and row.name in figures):
        return -math.inf
    return row.weighed(figures) - WEIGHTS[row.name].at_best()
