"""What changed from one view of a site to another: the one way to say it.

A view is a few tables of entries with ids. Most of them are what they were in the view before, so
whoever takes a view over by its change keeps the objects that he has, and whoever compares two
views that came to him so is done at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, cast, get_args, get_type_hints

from lineloom_core.codec import storable
from lineloom_core.mapping.answers.site_view import (
    ComponentView,
    ConstraintView,
    KeyframeView,
    MapLine,
    PlaceView,
    RobotView,
    SiteView,
)
from lineloom_core.mapping.answers.table_change import Same, TableChange
from lineloom_core.mapping.answers.trajectories import (
    NO_TRAJECTORIES,
    Trajectories,
    Way,
    Whereabouts,
)
from lineloom_core.mapping.facts.placed_scans import ScanBlock

EMPTY_VIEW = SiteView(
    version=0,
    robots={},
    components=(),
    merged_into={},
    trajectories=NO_TRAJECTORIES,
    lines=(),
    keyframes=(),
    constraints=(),
    settled=True,
)
"""What is known before the first scan: every view is a change of it."""


@storable("view-change")
@dataclass(frozen=True, slots=True)
class ViewChange:
    """By table, which entries are new or not what they were, and which are gone.

    version, settled: of the view after. ways, scans, whereabouts: what trajectories are put
    together of.
    """

    version: int
    robots: TableChange[str, RobotView]
    components: TableChange[str, ComponentView]
    merged_into: TableChange[str, str]
    lines: TableChange[str, MapLine]
    keyframes: TableChange[str, KeyframeView]
    constraints: TableChange[str, ConstraintView]
    places: TableChange[str, PlaceView]
    ways: TableChange[str, Way]
    scans: TableChange[str, ScanBlock]
    whereabouts: TableChange[str, Whereabouts]
    settled: bool

    def __bool__(self) -> bool:
        return any(self.tables().values())

    def tables(self) -> dict[str, TableChange[Any, Any]]:
        """Return the change of each table, by its name."""
        return {name: getattr(self, name) for name in TABLES}

    def with_tables(self, tables: Mapping[str, TableChange[Any, Any]]) -> ViewChange:
        """Return the change with these in place of all its tables'."""
        return ViewChange(self.version, settled=self.settled, **tables)

    @classmethod
    def between(cls, before: SiteView, after: SiteView) -> ViewChange:
        """Compare two views to the last bit: `between(a, b).apply(a)` is b.

        Raises TypeError for a view whose trajectories are put together already.
        """
        same = Same()
        changes = {
            name: TableChange()
            if _source(before, name) is _source(after, name)
            else TableChange.between(_table(before, name), _table(after, name), same)
            for name in TABLES
        }
        return cls(after.version, settled=after.settled, **changes)

    def apply(self, before: SiteView) -> SiteView:
        """Return the view after; what did not change in it are the same objects.

        Raises KeyError, TypeError or ValueError where it is the change of another view.
        """
        now = {
            name: change.apply(_table(before, name))
            for name, change in self.tables().items()
            if change
        }
        changed: dict[str, Any] = {
            name: tuple(table.values()) if name in _BY_ID else table
            for name, table in now.items()
            if name not in _OF_TRAJECTORIES
        }
        if len(changed) < len(now):
            changed["trajectories"] = _trajectories(_made_of(before), now)
        return replace(before, version=self.version, settled=self.settled, **changed)


TABLES: Mapping[str, type] = {
    name: get_args(kind)[1] for name, kind in get_type_hints(ViewChange).items() if get_args(kind)
}
"""The tables of a view, and what their entries are."""

_BY_ID = {"components", "lines", "keyframes", "constraints", "places"}
_OF_TRAJECTORIES = {"ways": "ways", "scans": "blocks", "whereabouts": "keyframes"}


def _source(view: SiteView, name: str) -> Any:
    """What of a view a table is made of."""
    own = _OF_TRAJECTORIES.get(name)
    return getattr(view, name) if own is None else getattr(_made_of(view), own)


def _table(view: SiteView, name: str) -> Mapping[Any, Any]:
    source: Any = _source(view, name)
    if name in _BY_ID:
        return {entry.id: entry for entry in source}
    if name == "whereabouts":
        return {"": source}
    if name == "scans":
        ways = _made_of(view).ways.items()
        ids = (f"{robot} {number}" for robot, way in ways for number in range(way.blocks))
        return dict(zip(ids, source, strict=True))
    return cast(Mapping[Any, Any], source)


def _made_of(view: SiteView) -> Trajectories:
    if not isinstance(view.trajectories, Trajectories):
        raise TypeError("trajectories that are put together already cannot be compared")
    return view.trajectories


def _trajectories(before: Trajectories, now: Mapping[str, Mapping[Any, Any]]) -> Trajectories:
    ways = dict(now.get("ways", before.ways))
    blocks = tuple(now["scans"].values()) if "scans" in now else before.blocks
    if sum(way.blocks for way in ways.values()) != len(blocks):
        raise ValueError(f"{len(blocks)} blocks of scans are not as many as the robots have")
    return Trajectories(ways, blocks, now.get("whereabouts", {"": before.keyframes})[""])
