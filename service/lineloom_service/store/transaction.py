"""One group commit: the writes of many requests, gathered so that they share statements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from sqlalchemy import Connection, bindparam, func, insert, select, update

from lineloom_service.store import tables
from lineloom_service.store.checksum import checksum_of
from lineloom_service.store.config_entry import OWN_ROBOT, ConfigEntry
from lineloom_service.store.feed_order import ORDER_ROBOT, Place, encode_order
from lineloom_service.store.ledger import Ledger, RobotLedger, SiteLedger
from lineloom_service.store.records import EntryKind, NewScan
from lineloom_service.store.sequencer import Sequencer, Stream

_PLACE_ENTRY = (
    update(tables.entries)
    .where(tables.entries.c.id == bindparam("entry"))
    .values(position=bindparam("place"), kind=bindparam("as_kind"))
)
_UPDATE_STREAM = (
    update(tables.streams)
    .where(tables.streams.c.id == bindparam("stream"))
    .values(
        released=bindparam("released"), highest=bindparam("highest"), accepted=bindparam("accepted")
    )
)
_UPDATE_SITE = (
    update(tables.sites)
    .where(tables.sites.c.id == bindparam("site"))
    .values(position=bindparam("place"), revision=bindparam("revision_now"))
)
_COUNT_ON = update(tables.clock).values(revision=bindparam("revision_now"))


class Transaction:
    """Changes ledger and database together. Used by the writer's thread only.

    connection: within a database transaction that has locked the clock and that the caller
    commits, after `flush`. term: the clock's. now: when it began, monotonic [s]. touched: the
    sites that changed, by id; gone: those deleted.
    """

    def __init__(self, connection: Connection, ledger: Ledger, term: int, now: float) -> None:
        self.connection = connection
        self.ledger = ledger
        self.term = term
        self.now = now
        self.touched: dict[int, SiteLedger] = {}
        self.gone: list[SiteLedger] = []
        self._counted_on = False
        self._released: dict[int, int] = {}
        self._new: dict[int, dict[str, Any]] = {}
        self._placed: list[dict[str, int | str]] = []
        self._late: set[int] = set()
        self._streams: dict[int, Stream] = {}

    def site(self, name: str) -> SiteLedger:
        """Return a site, made on first use."""
        site = self.ledger.sites.get(name)
        if site is None:
            site = SiteLedger(self._insert(tables.sites, name=name), name)
            self.ledger.sites[name] = site
            self.touched[site.id] = site
            if self.ledger.first_config is not None:
                self.add_config(site, self.ledger.first_config)
        return site

    def robot(self, site: SiteLedger, name: str) -> RobotLedger:
        """Return a robot, made on first use."""
        robot = site.robots.get(name)
        if robot is None:
            number = self._insert(tables.robots, site_id=site.id, name=name)
            order = Sequencer(self.ledger.window_s, self.ledger.max_held)
            robot = RobotLedger(number, name, order)
            site.robots[name] = robot
            site.changed.add(name)
            self.touched[site.id] = site
        return robot

    def stream(self, robot: RobotLedger, session: str) -> Stream:
        """Return a session of a robot, made on first use."""
        stream = robot.order.streams.get(session)
        if stream is None:
            number = self._insert(tables.streams, robot_id=robot.id, session=session)
            stream = robot.order.streams[session] = Stream(number, session)
        return stream

    def add_scan(self, site: SiteLedger, robot: RobotLedger, stream: Stream, scan: NewScan) -> None:
        """Store a scan that is new and has its seq; it has no place in the feed yet."""
        assert scan.seq is not None
        entry = self._add_entry(
            site, robot, "scan", stream_id=stream.id, seq=scan.seq, body=scan.body
        )
        late = robot.order.is_late(stream, scan.seq)
        stream.hold(scan.seq, entry, self.now, late=late)
        site.accepted += 1
        site.held += 1
        site.late += late
        self._streams[stream.id] = stream

    def add_control(
        self, site: SiteLedger, robot: RobotLedger, kind: EntryKind, body: bytes | None
    ) -> None:
        """Log an operator's action; it is released at once."""
        entry = self._add_entry(site, robot, kind, stream_id=None, seq=None, body=body)
        self._place(site, [entry])

    def add_config(self, site: SiteLedger, config: ConfigEntry) -> ConfigEntry:
        """Log what the site's map is made with from now on; it is released at once."""
        if site.own is None:
            number = self._insert(tables.robots, site_id=site.id, name=OWN_ROBOT, forgotten=True)
            order = Sequencer(self.ledger.window_s, self.ledger.max_held)
            site.own = RobotLedger(number, OWN_ROBOT, order)
        position, now = site.position + 1, site.config
        since = now.since if now is not None and now.digest == config.digest else position
        site.config = replace(config, position=position, since=since)
        body = site.config.encode()
        self.add_control(site, site.own, "config", body)
        own = tables.robots.c.id == site.own.id
        self.connection.execute(update(tables.robots).where(own).values(mount=body))
        return site.config

    def release_scans(
        self, site: SiteLedger, robot: RobotLedger, *, all_held: bool = False
    ) -> None:
        """Give the scans that need not wait any longer their places; or all of them."""
        waiting = [stream for stream in robot.order.streams.values() if stream.held]
        if not waiting:
            return
        entries = robot.order.flush() if all_held else robot.order.release(self.now)
        if entries:
            site.held -= len(entries)
            if robot.id in self._released:
                self._released[robot.id] += len(entries)
            site.changed.add(robot.name)
            self._place(site, entries)
            self._streams.update((stream.id, stream) for stream in waiting)
        if any(stream.held for stream in waiting):
            self.ledger.waiting[robot.id] = (site, robot)
        else:
            self.ledger.waiting.pop(robot.id, None)

    def append_late(self, site: SiteLedger, entries: Sequence[int], *, in_order: bool) -> list[int]:
        """Put scans that came late at the end of the log; return their positions there.

        in_order: an `order` that follows says where they belong; else they stay there.
        """
        begin = site.position
        if in_order:
            self._late.update(entries)
        self._place(site, entries)
        site.held -= len(entries)
        site.late -= len(entries)
        return list(range(begin + 1, site.position + 1))

    def add_order(self, site: SiteLedger, places: Sequence[Place]) -> None:
        """Log where the late scans before it belong; it is released at once."""
        if site.places is None:
            number = self._insert(tables.robots, site_id=site.id, name=ORDER_ROBOT, forgotten=True)
            order = Sequencer(self.ledger.window_s, self.ledger.max_held)
            site.places = RobotLedger(number, ORDER_ROBOT, order)
        self.add_control(site, site.places, "order", encode_order(site.order, places))
        site.order = site.position
        row = tables.robots.c.id == site.places.id
        last = str(site.order).encode()
        self.connection.execute(update(tables.robots).where(row).values(mount=last))

    def known(self, stream: Stream, seqs: Sequence[int]) -> dict[int, bytes]:
        """Return the scans of these `seqs` that the stream has already, as they are stored."""
        doubtful = [seq for seq in seqs if seq <= stream.highest]
        found: dict[int, bytes] = {}
        if doubtful:
            self.flush()
            c = tables.entries.c
            # In portions: a database takes a limited number of parameters in a statement.
            for start in range(0, len(doubtful), 500):
                portion = doubtful[start : start + 500]
                query = select(c.seq, c.body).where(c.stream_id == stream.id, c.seq.in_(portion))
                found.update((row.seq, row.body) for row in self.connection.execute(query))
        return found

    def latest(self, stream: Stream, limit: int) -> list[tuple[int, bytes]]:
        """Return the seqs and bodies of the scans with the highest seqs, in the order of seq."""
        self.flush()
        c = tables.entries.c
        query = select(c.seq, c.body).where(c.stream_id == stream.id)
        rows = self.connection.execute(query.order_by(c.seq.desc()).limit(limit))
        return [(row.seq, row.body) for row in rows][::-1]

    def remove_site(self, site: SiteLedger) -> None:
        """Forget a site. Its rows go later, in portions that block nobody."""
        self.flush()
        self.touched.pop(site.id, None)
        self.ledger.remove(site)
        self.gone.append(site)
        self.connection.execute(
            update(tables.sites).where(tables.sites.c.id == site.id).values(deleted=True)
        )

    def released_after(self, site: SiteLedger, robot: RobotLedger, position: int) -> int:
        """Count a robot's entries behind a position, once a commit: its own are added here."""
        if robot.id not in self._released:
            self.flush()
            c = tables.entries.c
            query = select(func.count()).where(
                c.site_id == site.id, c.position > position, c.robot_id == robot.id
            )
            self._released[robot.id] = self.connection.execute(query).scalar_one()
        return self._released[robot.id]

    def flush(self) -> None:
        """Send what was gathered to the database."""
        if (self.touched or self.gone) and not self._counted_on:
            self._counted_on = True
            self.ledger.revision += 1
            self.connection.execute(_COUNT_ON, {"revision_now": self.ledger.revision})
        if self._new:
            self.connection.execute(insert(tables.entries), list(self._new.values()))
        if self._placed:
            self.connection.execute(_PLACE_ENTRY, self._placed)
        if self._streams:
            self.connection.execute(_UPDATE_STREAM, [_row(s) for s in self._streams.values()])
        if self.touched:
            places = [
                {"site": s.id, "place": s.position, "revision_now": self.ledger.revision}
                for s in self.touched.values()
            ]
            self.connection.execute(_UPDATE_SITE, places)
        self._new = {}
        self._placed = []
        self._streams = {}

    def _add_entry(
        self, site: SiteLedger, robot: RobotLedger, kind: EntryKind, **columns: object
    ) -> int:
        entry = self.ledger.next_entry
        self.ledger.next_entry += 1
        self._new[entry] = {
            "id": entry,
            "site_id": site.id,
            "robot_id": robot.id,
            "kind": kind,
            "position": None,
            **columns,
        }
        self._new[entry]["crc"] = checksum_of(self._new[entry])
        site.changed.add(robot.name)
        self.touched[site.id] = site
        return entry

    def _place(self, site: SiteLedger, entries: Iterable[int]) -> None:
        for entry in entries:
            site.position += 1
            kind = "late" if entry in self._late else None
            if entry in self._new:
                self._new[entry]["position"] = site.position
                self._new[entry]["kind"] = kind or self._new[entry]["kind"]
            else:
                # Only scans are placed after the commit that brought them.
                where = {"entry": entry, "place": site.position}
                self._placed.append({**where, "as_kind": kind or "scan"})
        self.touched[site.id] = site

    def _insert(self, table: Any, **values: object) -> int:
        result = self.connection.execute(insert(table).values(**values))
        key = result.inserted_primary_key
        assert key is not None
        return int(key[0])


def _row(stream: Stream) -> dict[str, Any]:
    return {
        "stream": stream.id,
        "released": stream.released,
        "highest": stream.highest,
        "accepted": stream.accepted,
    }
