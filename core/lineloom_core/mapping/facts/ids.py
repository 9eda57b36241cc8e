"""Ids that outlive a replay: short digests of the names of the scans that a thing rests on.

Whatever order a log is gone through in, under whatever parameters: what rests on the same scans has
the same id. 80 bits: among the 10^8 things of a site that is driven in for decades, two share an id
with a probability of 4 in 10^9.
"""

from __future__ import annotations

import base64
import json
from functools import lru_cache
from hashlib import blake2b
from typing import Literal

from lineloom_core.mapping.facts.scan_name import ScanName

Named = Literal["keyframe", "place", "component", "step", "near", "recognition", "operator"]

_LETTERS: dict[Named, str] = {
    "keyframe": "k", "place": "p", "component": "c", "step": "s", "near": "n", "recognition": "r",
    "operator": "o",
}  # fmt: skip


@lru_cache(maxsize=1 << 15)
def id_of(what: Named, *scans: ScanName) -> str:
    """The id of what rests on these scans, as in `k-4hqxw2oklm3dv7ye`; their order means nothing.

    keyframe: its scan. place: the scan of its last keyframe. component: that of the first keyframe
    of its oldest track. step: the scan that it leads to. near: both scans that were registered.
    recognition: the scans of both places. operator: both scans that were said to be near.
    """
    rows = sorted([s.robot, s.session, s.seq, *([s.repeat] if s.repeat else [])] for s in scans)
    digest = blake2b(json.dumps(rows).encode(), digest_size=10, person=what.encode()).digest()
    return f"{_LETTERS[what]}-{base64.b32encode(digest).decode().lower()}"
