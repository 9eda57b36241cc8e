"""What is refused because a verdict stands against it, and what is kept because one stands for it.

An operator who retracts a meeting of two robots means the meeting, not the one pair of places:
everything that would put the two maps together in the same way is refused with it.
"""

from __future__ import annotations

from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.sameness import is_meant, says_the_same
from lineloom_core.mapping.belief.site_map import SiteMap


def refuse_barred(site: SiteMap, candidates: list[Constraint]) -> list[Constraint]:
    """Reject those candidates that say the same as one that is barred; return the others."""
    free = []
    for c in candidates:
        barred = next((b for b in _recognitions(site) if says_the_same(site, b, c)), None)
        if barred is None:
            free.append(c)
            continue
        how = "retracted" if barred.id in site.verdicts.retracted else "withdrawn"
        stored = site.constraints[c.id]
        site.add_constraint(
            stored.moved_to("rejected", f"says the same as {barred.id}, which was {how}", site.now)
        )
    return free


def is_barred(site: SiteMap, found: Constraint) -> bool:
    """Whether an operator has retracted what has been found, under whatever id."""
    return any(is_meant(site, r, found) for r in site.verdicts.retracted.values())


def is_approved(site: SiteMap, constraint: Constraint) -> bool:
    """Whether an operator has said or restored a constraint, so that it is not withdrawn."""
    said = constraint.kind == "operator" or constraint.id in site.verdicts.approved
    return said or any(is_meant(site, a, constraint) for a in site.verdicts.vouched.values())


def _recognitions(site: SiteMap) -> list[Constraint]:
    return [c for c in site.verdicts.all_barred() if c.origin == "recognition"]
