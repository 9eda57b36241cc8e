"""What the writer knows of each site without asking the database.

There is one writer, so its memory is the truth between two commits; after a failed one it is
thrown away and read again.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from sqlalchemy import Connection, select

from lineloom_service.store import tables
from lineloom_service.store.records import RobotRecord, SiteRecord
from lineloom_service.store.sequencer import Sequencer, Stream


@dataclass(slots=True)
class RobotLedger:
    """A robot and the order of its scans."""

    id: int
    name: str
    order: Sequencer
    mount: bytes | None = None

    def record(self) -> RobotRecord:
        """Return what others may know."""
        return RobotRecord(self.name, self.order.accepted, self.order.held, self.mount)


@dataclass(slots=True)
class SiteLedger:
    """A site: `position` is that of the entry released last.

    accepted: scans ever taken, those of robots since forgotten included: they stay in the log.
    held: those of them that wait. changed: robots whose record is out of date.
    """

    id: int
    name: str
    position: int = 0
    accepted: int = 0
    held: int = 0
    robots: dict[str, RobotLedger] = field(default_factory=dict)
    changed: set[str] = field(default_factory=set)
    _records: dict[str, RobotRecord] = field(default_factory=dict)

    def record(self) -> SiteRecord:
        """Return what others may know. Costs as much as changed since the last time."""
        if self.changed:
            records = dict(self._records)
            for name in self.changed:
                records.pop(name, None)
                if name in self.robots:
                    records[name] = self.robots[name].record()
            self._records = records
            self.changed = set()
        return SiteRecord(
            id=self.id,
            name=self.name,
            position=self.position,
            held=self.held,
            accepted=self.accepted,
            robots=self._records,
        )


@dataclass(slots=True)
class Ledger:
    """All sites by name, and the id that the next log entry gets.

    waiting: the robots that hold scans back, by id.
    """

    sites: dict[str, SiteLedger]
    next_entry: int
    waiting: dict[int, tuple[SiteLedger, RobotLedger]] = field(default_factory=dict)


def read_ledger(connection: Connection, now: float, window_s: float, max_held: int) -> Ledger:
    """Read the writer's memory from the database. Held scans start waiting anew at `now`."""
    sites = {
        row.id: SiteLedger(row.id, row.name, row.position)
        for row in connection.execute(select(tables.sites).where(tables.sites.c.deleted.is_(False)))
    }
    streams = _read_streams(connection, now)
    waiting: dict[int, tuple[SiteLedger, RobotLedger]] = {}
    for row in connection.execute(select(tables.robots).order_by(tables.robots.c.id)):
        site = sites.get(row.site_id)
        if site is None:
            continue
        robot = RobotLedger(
            row.id, row.name, Sequencer(window_s, max_held, streams.get(row.id, ())), row.mount
        )
        site.accepted += robot.order.accepted
        if row.forgotten:
            continue
        site.held += robot.order.held
        site.robots[row.name] = robot
        site.changed.add(row.name)
        if robot.order.held:
            waiting[robot.id] = (site, robot)
    last = connection.execute(
        select(tables.entries.c.id).order_by(tables.entries.c.id.desc()).limit(1)
    ).scalar()
    return Ledger({site.name: site for site in sites.values()}, (last or 0) + 1, waiting)


def _read_streams(connection: Connection, now: float) -> dict[int, list[Stream]]:
    by_robot: dict[int, list[Stream]] = {}
    by_id: dict[int, Stream] = {}
    for row in connection.execute(select(tables.streams).order_by(tables.streams.c.id)):
        stream = Stream(row.id, row.session, row.released, row.highest, row.accepted)
        by_robot.setdefault(row.robot_id, []).append(stream)
        by_id[row.id] = stream
    entries = tables.entries.c
    held = (
        select(entries.id, entries.stream_id, entries.seq)
        .where(entries.position.is_(None))
        .order_by(entries.id)
    )
    for row in connection.execute(held):
        by_id[row.stream_id].held[row.seq] = (row.id, now)
    return by_robot
