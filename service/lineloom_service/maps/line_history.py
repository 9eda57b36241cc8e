"""Since which version every line of a site is as it is, and which lines are gone since when."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from lineloom_core.mapping.answers.site_view import MapLine, SiteView
from lineloom_core.mapping.answers.table_change import TableChange

_VERSIONS = 1_000
"""Versions back to which a difference can be told."""


@dataclass(frozen=True, slots=True)
class Written:
    """A line and its JSON. since: the version with which it became so."""

    line: MapLine
    json: str
    since: int


@dataclass(frozen=True, slots=True)
class LineTable:
    """A site's lines at one version, in the view's order.

    removed: id -> version with which the line went. known: versions that a difference can be told
    from: those that this history was brought to, one after another.
    """

    version: int
    lines: dict[str, Written]
    removed: dict[str, int]
    known: frozenset[int]


class LineHistory:
    """Brought from version to version. write: returns a line's JSON; called when it changes."""

    def __init__(self, write: Callable[[MapLine], str]) -> None:
        self._write = write
        self._lock = threading.Lock()
        self._versions: deque[int] = deque(maxlen=_VERSIONS)
        self._table = LineTable(-1, {}, {}, frozenset())

    def at(self, view: SiteView) -> LineTable:
        """Return the table of a view. One older than the history's has no history of its own."""
        with self._lock:
            if view.version > self._table.version:
                self._table = self._advanced(view)
            if view.version == self._table.version:
                return self._table
        return LineTable(view.version, self._change({}, view).apply({}), {}, frozenset())

    def _advanced(self, view: SiteView) -> LineTable:
        self._versions.append(view.version)
        change = self._change(self._table.lines, view)
        lines = change.apply(self._table.lines)
        removed = self._table.removed | dict.fromkeys(change.gone, view.version)
        return LineTable(
            view.version,
            lines,
            {
                id: version
                for id, version in removed.items()
                if version > self._versions[0] and id not in lines
            },
            frozenset(self._versions),
        )

    def _change(self, before: dict[str, Written], view: SiteView) -> TableChange[str, Written]:
        known = {id: written.line for id, written in before.items()}
        change = TableChange.between(known, {line.id: line for line in view.lines})
        return change.mapped(lambda line: Written(line, self._write(line), view.version))
