"""Where was this scan taken? Asked of the map, which does not change by it.

Steps of `localise`:
 1. make a place of the scans, in the frame of the latest one;
 2. match it without any pose against every place of the site;
 3. keep the best spots that differ;
 4. hold each against all that the map knows around it: registration, free space both ways;
 5. rank them, name the rivals, and say how sure one can be.

"Unique" is a promise: it takes a spot that explains what was seen, that no other spot rivals in any
component, and a map that is large enough to know what else looks alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.checks import LOCALISED
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.localisation import (
    Localisation,
    LocalisationVerdict,
    PoseHypothesis,
)
from lineloom_core.mapping.answers.localise_score import probability
from lineloom_core.mapping.answers.query_place import query_place
from lineloom_core.mapping.answers.surroundings import surroundings
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.config import LocaliseConfig
from lineloom_core.mapping.facts.information import INDEPENDENT_SHARE, turned
from lineloom_core.places import (
    Place,
    check_alignment,
    evidence_for,
    evidence_of,
    hypotheses,
    is_rival,
    share_explained,
)
from lineloom_core.scan import Scan

_FLOOR = np.diag([0.01**2, 0.01**2, 0.003**2])  # m^2, m^2, rad^2: a map is no better than that


@dataclass(frozen=True, slots=True)
class _Spot:
    """A pose of the query in the frame of a component, found in one place of it."""

    place: Place
    component: str
    pose: Pose
    evidence: float


def localise(
    site: SiteMap, scans: Sequence[Scan], config: LocaliseConfig | None = None
) -> Localisation:
    """Find where the latest of one robot's scans was taken; a pure function of its arguments."""
    config = config or site.config.localise
    query = query_place(scans, site.config)
    if query is None:
        return Localisation("unknown", "no scan shows anything")
    spots = _distinct(_find_spots(site, query, config), config)
    checked = [found for spot in spots if (found := _check(site, query, spot, config))]
    ranked = _ranked(checked, config)
    verdict, reason = _verdict(ranked, config)
    return Localisation(verdict, reason, query.anchor, tuple(ranked))


def _find_spots(site: SiteMap, query: Place, config: LocaliseConfig) -> list[_Spot]:
    """Step 2: every hypothesis of every place, best first."""
    found = []
    for place in site.places.values():
        at, component = site.pose(place.anchor), site.component_id(place.anchor)
        for row in hypotheses(place, query, config.recognition):
            pose = at @ Pose.from_array(row[:3])
            found.append(_Spot(place, component, pose, evidence_of(row)))
    return sorted(found, key=lambda s: (-s.evidence, s.place.id))


def _distinct(spots: list[_Spot], config: LocaliseConfig) -> list[_Spot]:
    """Step 3: neighbouring places show the same spot; keep its best sight."""
    kept: list[_Spot] = []
    for spot in spots:
        if len(kept) == config.spots:
            break
        if not any(
            s.component == spot.component and _same(s.pose, spot.pose, config) for s in kept
        ):
            kept.append(spot)
    return kept


def _same(a: Pose, b: Pose, config: LocaliseConfig) -> bool:
    return not is_rival(a, b, config.recognition)


def _check(
    site: SiteMap, query: Place, spot: _Spot, config: LocaliseConfig
) -> PoseHypothesis | None:
    """Step 4: hold a spot against everything that is known around it."""
    around, T_map_around = surroundings(
        site, spot.place.anchor, spot.pose, radius=config.surround, most=config.most_keyframes
    )
    guess = T_map_around.between(spot.pose)
    registered = around.register(query, guess)
    if registered.pose.distance(guess) > config.recognition.rival_distance:
        return None  # it slid to another spot, which stands in the list by itself if it is one
    checks = check_alignment(around, query, registered)
    checks["own_conflict"] = around.own_conflict + query.own_conflict
    checks["explained"] = share_explained(around, query, registered.pose)
    checks["evidence"] = evidence_for(checks["matched"], checks["conflict"])
    checks["places"] = float(site.places_in_component(spot.place.anchor))
    return PoseHypothesis(
        component=spot.component,
        pose=T_map_around @ registered.pose,
        covariance=_covariance(registered.information, T_map_around.theta),
        score=0.0,
        checks=checks,
    )


def _covariance(information: NDArray[np.float64], theta: float) -> NDArray[np.float64]:
    """Covariance in the map's axes; what nothing observes stays within metres."""
    in_map = turned(INDEPENDENT_SHARE * information, -theta)
    covariance = np.linalg.inv(in_map + np.diag([0.1, 0.1, 0.1])) + _FLOOR
    symmetric: NDArray[np.float64] = 0.5 * (covariance + covariance.T)
    return symmetric


def _ranked(checked: list[PoseHypothesis], config: LocaliseConfig) -> list[PoseHypothesis]:
    """Step 5: the best first, each with its lead over the best of the others, and its score."""
    kept: list[PoseHypothesis] = []
    for h in sorted(checked, key=lambda h: (-h.checks["evidence"], h.component)):
        twin = any(h.component == k.component and _same(h.pose, k.pose, config) for k in kept)
        if h.checks["evidence"] > 0.0 and not twin:
            kept.append(h)
    ranked = []
    for h in kept:
        rival = max((o.checks["evidence"] for o in kept if o is not h), default=0.0)
        checks = {**h.checks, "margin": 1.0 - rival / h.checks["evidence"]}
        limits = LOCALISED.limits(config, checks)
        ranked.append(replace(h, checks=checks, limits=limits, score=probability(checks)))
    return ranked


def _verdict(
    ranked: list[PoseHypothesis], config: LocaliseConfig
) -> tuple[LocalisationVerdict, str]:
    if not ranked:
        return "unknown", "nothing in the map looks like it"
    row = LOCALISED.against(config, ranked[0].checks)
    if row is not None:
        known = row.name not in ("matched", "explained", "conflict_share")
        return "ambiguous" if known else "unknown", row.objection
    if ranked[0].score < config.least_score:
        return "unknown", f"the best fit is right with a probability of only {ranked[0].score:.2f}"
    return "unique", "it fits here and nowhere else"
