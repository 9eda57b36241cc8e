"""What the writer knows of each site without asking the database.

Whoever writes locks the clock first, so this memory is the truth once it has caught up with the
clock's revision; after a failed commit it is thrown away and read again.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from sqlalchemy import Connection, Select, select

from lineloom_service.store import tables
from lineloom_service.store.config_entry import OWN_ROBOT, ConfigEntry
from lineloom_service.store.feed_order import ORDER_ROBOT, parted
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
        order = self.order
        return RobotRecord(self.name, order.accepted, order.held, self.mount, order.late)


@dataclass(slots=True)
class SiteLedger:
    """A site: `position` is that of the entry released last.

    accepted: scans ever taken, those of robots since forgotten included: they stay in the log.
    held: those of them that wait, the `late` ones among them. config: what its map is made with;
    own: the robot that such entries belong to. order: position of the entry that gave late scans
    their places last; places: the robot that such entries belong to. changed: robots whose record
    is out of date.
    """

    id: int
    name: str
    position: int = 0
    accepted: int = 0
    held: int = 0
    robots: dict[str, RobotLedger] = field(default_factory=dict)
    late: int = 0
    config: ConfigEntry | None = None
    own: RobotLedger | None = None
    order: int = 0
    places: RobotLedger | None = None
    changed: set[str] = field(default_factory=set)
    _records: dict[str, RobotRecord] = field(default_factory=dict)

    def record(self, *, deleted: bool = False) -> SiteRecord:
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
            config=self.config,
            deleted=deleted,
            late=self.late,
            order=self.order,
        )

    def is_in_force(self, producer: str) -> bool:
        """Whether what the log orders makes this producer's map (`engine.making.Making.id`)."""
        made, order = parted(producer)
        return order == self.order and (self.config is None or made == self.config.making)


@dataclass(slots=True)
class Ledger:
    """All sites by name, and the id that the next log entry gets.

    revision: the clock's that this is the truth of. waiting: the robots that hold scans back, by
    id. first_config: what a new site's log begins with, if with anything.
    """

    window_s: float
    max_held: int
    sites: dict[str, SiteLedger] = field(default_factory=dict)
    next_entry: int = 1
    revision: int = -1
    waiting: dict[int, tuple[SiteLedger, RobotLedger]] = field(default_factory=dict)
    first_config: ConfigEntry | None = None

    def add(self, site: SiteLedger) -> None:
        """Take a site in."""
        self.sites[site.name] = site
        for robot in site.robots.values():
            if robot.order.held:
                self.waiting[robot.id] = (site, robot)

    def remove(self, site: SiteLedger) -> None:
        """Forget a site."""
        del self.sites[site.name]
        for robot in site.robots.values():
            self.waiting.pop(robot.id, None)

    def next_deadline(self) -> float | None:
        """When the scan that waits longest must go out; None when none waits."""
        deadlines = [robot.order.next_deadline() for _, robot in self.waiting.values()]
        return min((deadline for deadline in deadlines if deadline is not None), default=None)

    def catch_up(self, connection: Connection, revision: int, now: float) -> list[SiteRecord]:
        """Read what others changed, up to the clock's `revision`; return those sites.

        A scan that has been held since before keeps its time of arrival; others arrive `now`.
        """
        if revision == self.revision:
            return []
        here = {site.id: site for site in self.sites.values()}
        rows = connection.execute(
            select(tables.sites).where(tables.sites.c.deleted.is_(False))
        ).all()
        alive = {row.id for row in rows}
        gone = [site for site in here.values() if site.id not in alive]
        fresh = [
            SiteLedger(row.id, row.name, row.position)
            for row in rows
            if row.revision > self.revision
        ]
        _read_robots(connection, fresh, self, now)
        for site in [*gone, *(here[site.id] for site in fresh if site.id in here)]:
            self.remove(site)
        for site in fresh:
            self.add(site)
        last = select(tables.entries.c.id).order_by(tables.entries.c.id.desc()).limit(1)
        self.next_entry = max(self.next_entry, (connection.execute(last).scalar() or 0) + 1)
        self.revision = revision
        return [site.record(deleted=True) for site in gone] + [site.record() for site in fresh]


def _read_robots(
    connection: Connection, sites: Iterable[SiteLedger], ledger: Ledger, now: float
) -> None:
    by_id = {site.id: site for site in sites}
    if not by_id:
        return
    arrived = {
        entry: time
        for _, robot in ledger.waiting.values()
        for stream in robot.order.streams.values()
        for entry, time in stream.held.values()
    }
    changed = select(tables.sites.c.id).where(
        tables.sites.c.deleted.is_(False), tables.sites.c.revision > ledger.revision
    )
    streams = _read_streams(connection, changed, arrived, now)
    robots = select(tables.robots).where(tables.robots.c.site_id.in_(changed))
    for row in connection.execute(robots.order_by(tables.robots.c.id)):
        site = by_id[row.site_id]
        order = Sequencer(ledger.window_s, ledger.max_held, streams.get(row.id, ()))
        site.accepted += order.accepted
        if row.name == OWN_ROBOT:
            site.own = RobotLedger(row.id, row.name, order)
            site.config = None if row.mount is None else ConfigEntry.decode(row.mount)
        elif row.name == ORDER_ROBOT:
            site.places = RobotLedger(row.id, row.name, order)
            site.order = int(row.mount or b"0")
        elif not row.forgotten:
            site.held += order.held + order.late
            site.late += order.late
            site.robots[row.name] = RobotLedger(row.id, row.name, order, row.mount)
            site.changed.add(row.name)


def _read_streams(
    connection: Connection, sites: Select[tuple[int]], arrived: dict[int, float], now: float
) -> dict[int, list[Stream]]:
    by_robot: dict[int, list[Stream]] = {}
    by_id: dict[int, Stream] = {}
    robots = select(tables.robots.c.id).where(tables.robots.c.site_id.in_(sites))
    query = select(tables.streams).where(tables.streams.c.robot_id.in_(robots))
    for row in connection.execute(query.order_by(tables.streams.c.id)):
        stream = Stream(row.id, row.session, row.released, row.highest, row.accepted)
        by_robot.setdefault(row.robot_id, []).append(stream)
        by_id[row.id] = stream
    entries = tables.entries.c
    held = (
        select(entries.id, entries.stream_id, entries.seq)
        .where(entries.site_id.in_(sites), entries.position.is_(None))
        .order_by(entries.id)
    )
    orders = {
        stream.id: Sequencer(0.0, 0, robot) for robot in by_robot.values() for stream in robot
    }
    for row in connection.execute(held):
        stream = by_id[row.stream_id]
        late = orders[stream.id].is_late(stream, row.seq)
        stream.keep(row.seq, row.id, arrived.get(row.id, now), late=late)
    return by_robot
