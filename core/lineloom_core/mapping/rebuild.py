"""Going through the history again under other verdicts: undo, redo, what-if, second thoughts.

What is retracted leaves no trace, because the map is made anew as if it had never been believed.
Places and recognitions are remembered, so that this costs little more than solving the graph.
"""

from __future__ import annotations

from lineloom_core.mapping.advance import advance
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.history import History
from lineloom_core.mapping.memory import Memory
from lineloom_core.mapping.site_map import SiteMap
from lineloom_core.mapping.verdicts import Verdicts


def rebuild(config: MapperConfig, history: History, memory: Memory, verdicts: Verdicts) -> SiteMap:
    """The map that the history gives under these verdicts.

    Where a keyframe contradicts what was believed before it, that is withdrawn and the history
    gone through again. This ends, as every round withdraws at least one constraint more.
    """
    while True:
        site = SiteMap(config, memory, verdicts)
        for keyframe in history.keyframes.values():
            contradicted = advance(site, keyframe).contradicted
            if contradicted:
                verdicts = verdicts.withdraw(contradicted)
                break
        else:
            return site
