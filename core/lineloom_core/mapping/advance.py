"""What follows from one more keyframe: loops, places, merges, and second thoughts.

Steps of `advance`: 1. the keyframe and its step enter the graph; 2. loops are closed with older
keyframes that the graph says are near; 3. every few metres, a place is made of the last keyframes
and looked for among all others; 4. sets of candidates that agree are believed, components joined
and tied together where they run near each other; 5. what the new place contradicts is named;
6. else places are let go where more than enough show the same.
"""

from __future__ import annotations

from dataclasses import dataclass

from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.place_making import place_is_due, recent_keyframes
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.belief.thinning import thin
from lineloom_core.mapping.belief.track import Track
from lineloom_core.mapping.facts.keyframe import Keyframe
from lineloom_core.mapping.merging.candidates import consider
from lineloom_core.mapping.merging.component_merged import ComponentMerged
from lineloom_core.mapping.merging.contradictions import contradicted_by
from lineloom_core.mapping.merging.near_loops import close_nearby
from lineloom_core.places import Place

_CLOSURES_UNSOLVED = 6
_KEYFRAMES_A_CLOSURE = 500
"""Small closures wait until there are a few; in a large map, which takes long to solve, until there
is one for so many keyframes."""


@dataclass(frozen=True, slots=True)
class Advance:
    """merges: components joined. optimised: poses moved. contradicted: no longer to be believed."""

    merges: tuple[ComponentMerged, ...] = ()
    optimised: bool = False
    contradicted: tuple[Constraint, ...] = ()


def advance(site: SiteMap, keyframe: Keyframe) -> Advance:
    """Take the next keyframe of the history."""
    site.append(keyframe)
    optimised = _close_loops(site, keyframe.id)
    place = _place_if_due(site, site.track(keyframe.id)) if keyframe.trusted else None
    if place is None:
        return Advance(optimised=optimised)
    merges, moved = consider(site, place)
    for merge in merges:
        _tie_after(site, merge)
    contradicted = contradicted_by(site, place)
    if not contradicted:
        thin(site, place)
    return Advance(tuple(merges), optimised or moved, contradicted)


def contradicted_by_next(site: SiteMap, keyframe: Keyframe) -> tuple[Constraint, ...]:
    """Take the next keyframe of the history; what it shows to be wrong (for `rebuild`)."""
    return advance(site, keyframe).contradicted


def _close_loops(site: SiteMap, keyframe: int) -> bool:
    """Close a loop if there is one; solve the graph unless it says what was known."""
    if len(site.track(keyframe).keyframes) % site.config.closure.every:
        return False
    closed = close_nearby(site, keyframe)
    if closed is None:
        return False
    root = site.component_root(keyframe)
    waiting = site.unsolved.pop(root, 0) + 1
    step = closed.checks["moved_m"] + 2.0 * closed.checks["turned_rad"]
    enough = max(_CLOSURES_UNSOLVED, len(site.keyframes) // _KEYFRAMES_A_CLOSURE)
    if step < 0.05 and waiting < enough:
        site.unsolved[root] = waiting
        return False  # it can wait for the next that says more
    site.optimise(keyframe)
    return True


def _place_if_due(site: SiteMap, track: Track) -> Place | None:
    """Make a place when the robot has driven on far enough."""
    config = site.config.places
    if not place_is_due(track, config):
        return None
    track.last_place_at = track.travelled[-1]
    members = recent_keyframes(track, config)
    if len(members) < config.least_keyframes:
        return None
    place = site.add_place(tuple(members))
    track.places.append(place.id)
    return place


def _tie_after(site: SiteMap, merge: ComponentMerged) -> None:
    """After a merge, tie the two parts wherever they run near each other."""
    members = [k for k in sorted(site.keyframes) if site.component_id(k) == merge.survivor]
    closed = [close_nearby(site, k) for k in members if k % 2 == 0]
    if any(closed):
        site.optimise(members[0])
