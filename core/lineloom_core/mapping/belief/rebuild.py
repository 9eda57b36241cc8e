"""Going through the history again under other verdicts: undo, redo, what-if, second thoughts.

What is retracted leaves no trace, because the map is made anew as if it had never been believed:
from the last checkpoint that it cannot have touched. Places and recognitions are remembered, so
that this costs little more than solving the graph.
"""

from __future__ import annotations

from collections.abc import Callable

from lineloom_core.mapping.belief.checkpoints import Checkpoints
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.belief.verdicts import Verdicts
from lineloom_core.mapping.facts.keyframe import Keyframe

TakeKeyframe = Callable[[SiteMap, Keyframe], tuple[Constraint, ...]]
"""Let a map take its next keyframe; the constraints that this contradicts."""


def rebuild(
    checkpoints: Checkpoints, verdicts: Verdicts, affected: int, take: TakeKeyframe
) -> SiteMap:
    """The map that the history gives under these verdicts, the same up to keyframe `affected`.

    Where a keyframe contradicts what was believed before it, that is withdrawn and the history
    gone through again. This ends, as every round withdraws at least one constraint more.
    """
    while True:
        site, keyframes = checkpoints.resume(affected, verdicts)
        for keyframe in keyframes:
            contradicted = take(site, keyframe)
            if contradicted:
                verdicts = verdicts.withdraw(contradicted)
                affected = first_affected(contradicted)
                break
            checkpoints.note(site, keyframe.id)
        else:
            return site


def first_affected(constraints: tuple[Constraint, ...]) -> int:
    """The first keyframe at which it matters whether one of these is believed."""
    return min(
        # What stands for something else keeps hold of both its ends: neither may be let go before.
        (max if c.claim is None else min)(c.keyframe_a, c.keyframe_b)
        for c in constraints
    )
