"""What follows from one more keyframe: loops, places, merges, and second thoughts.

Steps of `advance`: 1. the keyframe and its step enter the graph, and what an operator said of it;
2. loops are closed with older
keyframes that the graph says are near; 3. every few metres, a place is made of the last keyframes
and looked for among all others, sooner where its robot lost its track, and what was left of that
one is as well; 4. sets of candidates that agree are believed, components joined and tied together
where they run near each other; 5. what the new place contradicts is named; 6. else places are let
go where more than enough show the same.
"""

from __future__ import annotations

from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.place_making import left_over, place_is_due, recent_keyframes
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.belief.thinning import thin
from lineloom_core.mapping.changes import Changes
from lineloom_core.mapping.facts.keyframe import Keyframe
from lineloom_core.mapping.merging.candidates import consider
from lineloom_core.mapping.merging.component_merged import ComponentMerged
from lineloom_core.mapping.merging.contradictions import contradicted_by
from lineloom_core.mapping.merging.join_said import join_said
from lineloom_core.mapping.merging.near_loops import close_near_loop
from lineloom_core.places import Place

_LOOPS_UNSOLVED = 6
_KEYFRAMES_A_LOOP = 500
"""Small loops wait until there are a few; in a large map, which takes long to solve, until there
is one for so many keyframes."""


def advance(site: SiteMap, keyframe: Keyframe) -> Changes:
    """Take the next keyframe of the history; what is withdrawn is still believed in `site`."""
    step = site.append(keyframe)
    merges, said = join_said(site, keyframe.id)
    for merge in merges:
        _tie_after(site, merge)
    moved = _near_loop_if_due(site, keyframe.id) or said
    contradicted: list[Constraint] = []
    for members in _due(site, keyframe, strayed=step is None) if keyframe.trusted else ():
        if not all(k in site.keyframes for k in members):
            continue  # let go just now, for the place before
        place = _made(site, members)
        merged, moved_too = consider(site, place)
        for merge in merged:
            _tie_after(site, merge)
        against = contradicted_by(site, place)
        if not against:
            thin(site, place)
        merges += merged
        contradicted += [c for c in against if c not in contradicted]
        moved = moved or moved_too or bool(against)
    return Changes(
        placed=True,
        keyframe=keyframe.name,
        merges=tuple(merges),
        withdrawn=tuple(contradicted),
        optimised=moved,
    )


def contradicted_by_next(site: SiteMap, keyframe: Keyframe) -> tuple[Constraint, ...]:
    """Take the next keyframe of the history; what it shows to be wrong (for `rebuild`)."""
    return advance(site, keyframe).withdrawn


def _near_loop_if_due(site: SiteMap, keyframe: int) -> bool:
    """Close a loop if there is one; solve the graph unless it says what was known."""
    if len(site.track(keyframe).keyframes) % site.config.near_loops.every:
        return False
    closed = close_near_loop(site, keyframe)
    if closed is None:
        return False
    root = site.component_root(keyframe)
    waiting = site.unsolved.pop(root, 0) + 1
    step = closed.checks["moved_m"] + 2.0 * closed.checks["turned_rad"]
    enough = max(_LOOPS_UNSOLVED, len(site.keyframes) // _KEYFRAMES_A_LOOP)
    if step < 0.05 and waiting < enough:
        site.unsolved[root] = waiting
        return False  # it can wait for the next that says more
    site.optimise(keyframe)
    return True


def _due(site: SiteMap, keyframe: Keyframe, *, strayed: bool) -> list[list[int]]:
    """Keyframes of the place that is due when the robot has driven on far enough.

    Or of all that it left behind, where it has strayed.
    """
    track, config = site.track(keyframe.id), site.config.places
    if strayed:
        former = site.track_before(track)
        return [] if former is None else left_over(former, config)
    # Of all tracks it is asked only while a track is young: there may be hundreds.
    young = track.travelled[-1] < config.span
    if not place_is_due(track, config, strayed=young and site.has_strayed(track)):
        return []
    track.last_place_at = track.travelled[-1]
    members = recent_keyframes(track, config)
    return [members] if len(members) >= config.least_keyframes else []


def _made(site: SiteMap, members: list[int]) -> Place:
    place = site.add_place(tuple(members))
    track = site.track(members[-1])
    track.places = sorted([*track.places, place.id])
    return place


def _tie_after(site: SiteMap, merge: ComponentMerged) -> None:
    """After a merge, tie the two parts wherever they run near each other."""
    members = [k for k in sorted(site.keyframes) if site.component_id(k) == merge.survivor]
    every = site.config.near_loops.every
    closed = [close_near_loop(site, k) for k in members if k % every == 0]
    if any(closed):
        site.optimise(members[0])
