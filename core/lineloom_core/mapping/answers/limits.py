"""Which figure of a constraint was held to which threshold."""

from __future__ import annotations

from lineloom_core.mapping.answers.evidence import Limit
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.config import MapperConfig

_Bounds = tuple[float | None, float | None]


def limits_of(constraint: Constraint, config: MapperConfig) -> dict[str, Limit]:
    """The limit of every figure in `checks` that decides anything, by its name."""
    bounds = _bounds(constraint, config)
    return {
        name: _limit(value, *bounds[name])
        for name, value in constraint.checks.items()
        if name in bounds
    }


def _limit(value: float, at_least: float | None, at_most: float | None) -> Limit:
    low = at_least is None or value >= at_least
    return Limit(at_least, at_most, low and (at_most is None or value <= at_most))


def _bounds(c: Constraint, config: MapperConfig) -> dict[str, _Bounds]:
    """(at least, at most) by check, for the way in which the constraint came about."""
    if c.kind == "sequential":
        tracker = config.tracker
        return {
            "fit": (tracker.least_fit, None),
            "conflict_share": (None, tracker.most_conflict),
        }
    if c.place_a < 0:
        closure = config.near_loops
        return {
            "fit": (closure.least_fit, None),
            "conflict_share": (None, closure.most_conflict),
            "moved_m": (None, 1.5 * closure.reach_xy),
            "turned_rad": (None, 1.5 * closure.reach_theta),
        }
    found, join = config.recognition, config.join
    return {
        "matched": (found.least_matched, None),
        "overlap": (found.least_overlap, None),
        "conflict_share": (None, found.most_conflict + c.checks.get("own_conflict", 0.0)),
        "missing_share": (None, found.most_missing),
        "margin": (found.least_margin, None),
        "information": (found.least_information, None),
        "set_size": (float(join.least_set), None),
        "set_evidence": (join.least_evidence, None),
        "rival_evidence": (None, c.checks.get("set_evidence", 0.0) / join.lead),
        "set_distinctive": (float(join.least_distinctive), None),
        "set_missing": (None, join.most_missing),
        "set_doubt": (None, join.most_doubt),
        "map_missing": (None, join.most_map_missing),
    }
