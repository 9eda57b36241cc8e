"""What a former version's log calls `p12-57`: found out from the snapshots that it left.

Those versions numbered keyframes in the order in which they came up, and an operator's action named
a constraint by such numbers. Which scans those keyframes were made of stands in the snapshots of
the very code that numbered them; other code numbers otherwise.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from lineloom_core.codec import inflate
from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.claim import Claim, Origin
from lineloom_core.mapping.facts.ids import id_of
from lineloom_core.mapping.facts.scan_name import ScanName

from lineloom_service.store.migrations.inert_pickle import Made, read_inert

_ORIGINS: Mapping[str, Origin] = {"s": "step", "n": "near", "p": "recognition"}
_NAME = re.compile(r"s\d{1,9}|[np]\d{1,9}-\d{1,9}")
_MOST_BYTES = 1 << 32
"""A state of more, inflated, is none that a mapper left."""


def meanings(state: bytes) -> Callable[[str], Claim | str | None]:
    """Return what tells, of a name that a former version gave, what it is about.

    state: a snapshot as it lies in the database. The answer is what the constraint said; where the
    snapshot does not have it, the id that it has now; None for numbers beyond the snapshot. Raises
    ValueError for what is no snapshot of a former version.
    """
    try:
        _, _, history, _, beliefs = read_inert(inflate(state, _MOST_BYTES))
        scans = _scan_names(history.state["_register"].state)
        site, _, _ = read_inert(beliefs)
        verdicts = site.state["verdicts"].state
        known = dict(site.state["constraints"])
        known |= verdicts["withdrawn"] | verdicts["retracted"]
        claims = {name: _claim(name, made.state, scans) for name, made in known.items()}
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise ValueError(f"not a snapshot of a former version: {error}") from error

    def meaning(name: str) -> Claim | str | None:
        return claims.get(name) or _id_now(name, scans)

    return meaning


def _scan_names(register: Mapping[str, Any]) -> list[ScanName]:
    """The scan of every keyframe, by number."""
    called = {number: name for name, number in register["_names"].items()}
    columns = [_column(register[name].state) for name in ("_robot", "_session", "_seq")]
    seen: Counter[tuple[int, ...]] = Counter()
    found = []
    for row in zip(*columns, strict=True):
        robot, session, seq = row
        found.append(ScanName(called[robot], called[session], seq, seen[row]))
        seen[row] += 1
    return found


def _column(growing: Mapping[str, Any]) -> list[int]:
    room: Made = growing["_room"]
    buffer, kind = room.arguments[0], room.arguments[1].arguments[0]
    if kind not in ("i4", "i8"):
        raise ValueError(f"a column of {kind}")
    numbers: list[int] = np.frombuffer(bytes(buffer), f"<{kind}").tolist()
    return numbers


def _claim(name: str, constraint: Mapping[str, Any], scans: list[ScanName]) -> Claim:
    a, b = (scans[constraint[end]] for end in ("keyframe_a", "keyframe_b"))
    T_a_b = Pose(*map(_number, constraint["T_a_b"].state))
    id_now = _id_now(name, scans)
    if id_now is None:
        raise ValueError(f"a constraint called {name!r}")
    return Claim(id_now, constraint["kind"], _ORIGINS[name[0]], a, b, T_a_b)


def _id_now(name: str, scans: list[ScanName]) -> str | None:
    if not _NAME.fullmatch(name):
        return None
    numbers = [int(number) for number in name[1:].split("-")]
    if max(numbers) >= len(scans):
        return None
    return id_of(_ORIGINS[name[0]], *(scans[number] for number in numbers))


def _number(value: Any) -> float:
    if isinstance(value, Made):  # one of numpy's
        return float(np.frombuffer(value.arguments[1], "<f8")[0])
    return float(value)
