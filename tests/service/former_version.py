"""A database as the first version left it: a site's log with retractions by number, and a snapshot.

Held byte for byte (log) and field for field (snapshot) against a file that commit 1e926c0 wrote.
"""

from __future__ import annotations

import pickle
import sys
import types
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import sqlalchemy as sa
from lineloom_core.geometry import Pose
from lineloom_lab.simulation import SimulatedScan
from lineloom_service.store.codec import encode_scan
from lineloom_service.store.migrate import migrate
from lineloom_service.store.sqlite_engine import sqlite_engine
from numpy.typing import NDArray

_CLASSES = {
    "History": "lineloom_core.mapping.history",
    "Register": "lineloom_core.mapping.register",
    "GrowingArray": "lineloom_core.graph.growing",
    "SiteMap": "lineloom_core.mapping.site_map",
    "Verdicts": "lineloom_core.mapping.verdicts",
    "Constraint": "lineloom_core.mapping.constraint",
}
_FORMAT = 10


@dataclass(frozen=True)
class Former:
    """A constraint as it was: its kind, the keyframes at its ends, and how they lay."""

    kind: str
    keyframe_a: int
    keyframe_b: int
    T_a_b: Pose


def snapshot(
    keyframes: Sequence[tuple[str, str, int]],
    constraints: Mapping[str, Former],
    retracted: Mapping[str, Former],
) -> bytes:
    """Return a snapshot as the first version saved it, of what of it is read today.

    keyframes: robot, session and number of their scans, in their order.
    """
    with _former_classes() as made:
        names = {
            name: i for i, name in enumerate(dict.fromkeys(n for k in keyframes for n in k[:2]))
        }

        def column(values: list[int], dtype: type[Any]) -> Any:
            room: NDArray[Any] = np.array(values, dtype=dtype)
            return made("GrowingArray", _room=room, _count=len(room))

        register = made(
            "Register",
            _names=names,
            _robot=column([names[robot] for robot, _, _ in keyframes], np.int32),
            _session=column([names[session] for _, session, _ in keyframes], np.int32),
            _seq=column([seq for _, _, seq in keyframes], np.int64),
        )
        verdicts = made("Verdicts", retracted=_made(made, retracted), withdrawn={})
        site = made("SiteMap", constraints=_made(made, constraints), verdicts=verdicts)
        beliefs = pickle.dumps((site, {}, len(keyframes)), protocol=5)
        history = made("History", _length=256, _register=register)
        return zlib.compress(pickle.dumps((_FORMAT, None, history, None, beliefs), protocol=5), 1)


def _made(made: Any, constraints: Mapping[str, Former]) -> dict[str, Any]:
    return {name: made("Constraint", id=name, **vars(c)) for name, c in constraints.items()}


@contextmanager
def _former_classes() -> Iterator[Any]:
    """What makes objects of classes that are gone, which are there as long as this is open."""
    there = {name: sys.modules.get(name) for name in _CLASSES.values()}
    classes = {}
    for name, home in _CLASSES.items():
        classes[name] = type(name, (), {"__module__": home})
        module = sys.modules[home] = types.ModuleType(home)
        setattr(module, name, classes[name])

    def made(name: str, **state: Any) -> Any:
        found: Any = object.__new__(classes[name])
        found.__dict__.update(state)
        return found

    try:
        yield made
    finally:
        for home, before in there.items():
            if before is None:
                del sys.modules[home]
            else:
                sys.modules[home] = before


def make_former_file(
    path: Path,
    scans: Sequence[SimulatedScan],
    actions: Sequence[tuple[str, str, str]],
    saved: bytes | None = None,
) -> None:
    """Make the file: the scans of site `s`, then actions (kind, robot, constraint)."""
    robots = {name: i for i, name in enumerate(dict.fromkeys(s.robot for s in scans), 1)}
    counts = {name: sum(s.robot == name for s in scans) for name in robots}
    entries: list[dict[str, Any]] = [
        {
            "robot_id": robots[s.robot],
            "kind": "scan",
            "stream_id": robots[s.robot],
            "seq": s.scan.seq,
            "body": encode_scan(s.scan),
        }
        for s in scans
    ]
    entries += [
        {
            "robot_id": robots[robot],
            "kind": kind,
            "stream_id": None,
            "seq": None,
            "body": constraint.encode(),
        }
        for kind, robot, constraint in actions
    ]
    end = len(entries)
    rows: dict[str, list[dict[str, Any]]] = {
        "sites": [{"id": 1, "name": "s", "position": end, "deleted": False, "revision": end}],
        "robots": [
            {"id": i, "site_id": 1, "name": name, "mount": None, "forgotten": False}
            for name, i in robots.items()
        ],
        "streams": [
            {
                **{"id": i, "robot_id": i, "session": "0", "accepted": counts[name]},
                **{"released": counts[name] - 1, "highest": counts[name] - 1},
            }
            for name, i in robots.items()
        ],
        "entries": [
            {"id": i, "site_id": 1, "position": i, **entry} for i, entry in enumerate(entries, 1)
        ],
        "snapshots": [
            {
                **{"site_id": 1, "position": end, "scans": len(scans), "producer": "0.1.0"},
                **{"data": saved, "chapters": 0},
            }
        ][: saved is not None],
    }
    engine = sqlite_engine(path)
    with engine.begin() as connection:
        migrate(connection, "0008")
        for name, of_table in rows.items():
            if of_table:
                table = sa.Table(name, sa.MetaData(), autoload_with=connection)
                connection.execute(sa.insert(table), of_table)
    engine.dispose()
