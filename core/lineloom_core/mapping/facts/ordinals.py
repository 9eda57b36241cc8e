"""Names by number, as logs of former versions have them: `s13`, `n3-40`, `p12-57`.

The numbers are those of keyframes in the order of the history, which this replay gives them too.
"""

from __future__ import annotations

import re

from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.facts.ids import Named, id_of

_KINDS: dict[str, Named] = {"s": "step", "n": "near", "p": "recognition"}
_ORDINAL = re.compile(r"(s)(\d+)|([np])(\d+)-(\d+)")


def id_of_ordinal(name: str, history: History) -> str:
    """The id of what a former version called so; any other name is one already."""
    found = _ORDINAL.fullmatch(name)
    if found is None:
        return name
    letter, *numbers = [part for part in found.groups() if part is not None]
    try:
        scans = [history[int(number)].scan_name for number in numbers]
    except KeyError:  # of a robot that was forgotten since
        return name
    return id_of(_KINDS[letter], *scans)
