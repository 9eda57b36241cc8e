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
    entries = _entries(robots, scans, actions)
    end = len(entries)
    snapshot = {
        **{"site_id": 1, "position": end, "scans": len(scans), "producer": "0.1.0"},
        **{"data": saved, "chapters": 0},
    }
    rows: dict[str, list[dict[str, Any]]] = {
        "sites": [{"id": 1, "name": "s", "position": end, "deleted": False, "revision": end}],
        "robots": [
            {"id": i, "site_id": 1, "name": name, "mount": None, "forgotten": False}
            for name, i in robots.items()
        ],
        "streams": [_stream(i, sum(s.robot == name for s in scans)) for name, i in robots.items()],
        "entries": entries,
        "snapshots": [] if saved is None else [snapshot],
    }
    engine = sqlite_engine(path)
    with engine.begin() as connection:
        migrate(connection, "0008")
        for name, of_table in rows.items():
            if of_table:
                table = sa.Table(name, sa.MetaData(), autoload_with=connection)
                connection.execute(sa.insert(table), of_table)
    engine.dispose()


def _entries(
    robots: Mapping[str, int],
    scans: Sequence[SimulatedScan],
    actions: Sequence[tuple[str, str, str]],
) -> list[dict[str, Any]]:
    """Rows of the log."""
    told: list[tuple[str, str, int | None, int | None, bytes]] = [
        ("scan", s.robot, robots[s.robot], s.scan.seq, encode_scan(s.scan)) for s in scans
    ]
    told += [(kind, robot, None, None, name.encode()) for kind, robot, name in actions]
    return [
        {
            **{"id": i, "site_id": 1, "position": i, "robot_id": robots[robot], "kind": kind},
            **{"stream_id": stream, "seq": seq, "body": body},
        }
        for i, (kind, robot, stream, seq, body) in enumerate(told, 1)
    ]


def _stream(number: int, count: int) -> dict[str, Any]:
    """The row of a robot's one session, all of it there."""
    return {
        **{"id": number, "robot_id": number, "session": "0", "accepted": count},
        **{"released": count - 1, "highest": count - 1},
    }
