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
    """A line and its JSON. since: the stage (`SiteView.stage`) with which it became so."""

    line: MapLine
    json: str
    since: tuple[int, bool]


@dataclass(frozen=True, slots=True)
class LineTable:
    """A site's lines at one stage, in the view's order.

    removed: id -> stage with which the line went. known: versions that a difference can be told
    from: those that this history was brought to, one after another.
    """

    stage: tuple[int, bool]
    lines: dict[str, Written]
    removed: dict[str, tuple[int, bool]]
    known: frozenset[int]


class LineHistory:
    """Brought from version to version. write: returns a line's JSON; called when it changes."""

    def __init__(self, write: Callable[[MapLine], str]) -> None:
        self._write = write
        self._lock = threading.Lock()
        self._versions: deque[int] = deque(maxlen=_VERSIONS)
        self._table = LineTable((-1, False), {}, {}, frozenset())

    def at(self, view: SiteView) -> LineTable:
        """Return the table of a view. One older than the history's has no history of its own."""
        with self._lock:
            if view.stage > self._table.stage:
                self._table = self._advanced(view)
            if view.stage == self._table.stage:
                return self._table
        return LineTable(view.stage, self._change({}, view).apply({}), {}, frozenset())

    def _advanced(self, view: SiteView) -> LineTable:
        if view.version != self._table.stage[0]:
            self._versions.append(view.version)
        change = self._change(self._table.lines, view)
        lines = change.apply(self._table.lines)
        removed = self._table.removed | dict.fromkeys(change.gone, view.stage)
        return LineTable(
            view.stage,
            lines,
            {
                id: stage
                for id, stage in removed.items()
                if stage > (self._versions[0], False) and id not in lines
            },
            frozenset(self._versions),
        )

    def _change(self, before: dict[str, Written], view: SiteView) -> TableChange[str, Written]:
        known = {id: written.line for id, written in before.items()}
        change = TableChange.between(known, {line.id: line for line in view.lines})
        return change.mapped(lambda line: Written(line, self._write(line), view.stage))
