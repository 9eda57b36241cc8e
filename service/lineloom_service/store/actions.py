"""What can be done to the log, each as one step of a group commit.

An action raises before its first write or not at all, so one refused request never spoils the
commit that it shares with others.
"""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import Connection, delete, func, insert, select, update

from lineloom_service.store import tables
from lineloom_service.store.config_entry import ConfigEntry
from lineloom_service.store.database import notify
from lineloom_service.store.files import FileKind, delete_file
from lineloom_service.store.identity import sort_out
from lineloom_service.store.ledger import SiteLedger
from lineloom_service.store.questions import drop_questions
from lineloom_service.store.records import (
    ActionKind,
    Appended,
    BacklogFullError,
    Conflict,
    EventBatch,
    NewScan,
    ViewRecord,
)
from lineloom_service.store.snapshots import purge_chapters
from lineloom_service.store.tombstones import Tombstone, bury
from lineloom_service.store.transaction import Transaction

_FORGET_EVENTS_EVERY = 64
_PURGE_PORTION = 2_000


def append_scans(
    tx: Transaction,
    site_name: str,
    robot_name: str,
    scans: Sequence[NewScan],
    *,
    processed: int,
    limit: int,
    robot_limit: int | None = None,
) -> Appended:
    """Store scans of one robot, creating site and robot on first use.

    Those that are new, in the order of seq; what need not wait is released. A scan without seq is
    numbered; one whose seq another scan of its session has is not taken, and told.
    Raises BacklogFullError, taking nothing, where more than `limit` entries wait already, or more
    than `robot_limit` of this robot's (as many as `limit` if None); `processed`: how many of the
    site's released entries the mapper is known to be through.
    """
    known_site = tx.ledger.sites.get(site_name)
    if known_site is not None:
        _check_backlog(known_site, len(scans), processed, limit)
        share = limit if robot_limit is None else robot_limit
        _check_robot(tx, known_site, robot_name, len(scans), processed, share)
    site = tx.site(site_name)
    robot = tx.robot(site, robot_name)
    by_session: dict[str, list[NewScan]] = {}
    for scan in scans:
        by_session.setdefault(scan.session, []).append(scan)
    accepted = duplicates = 0
    conflicts: list[Conflict] = []
    for session, sent in by_session.items():
        stream = tx.stream(robot, session)
        found = sort_out(tx, stream, sent)
        for new in found.new:
            tx.add_scan(site, robot, stream, new)
        accepted += len(found.new)
        duplicates += found.duplicates
        conflicts += found.conflicts
    tx.release_scans(site, robot)
    return Appended(accepted, duplicates, site.id, site.position, site.held, tuple(conflicts))


def _check_backlog(site: SiteLedger, coming: int, processed: int, limit: int) -> None:
    pending = site.position - processed + site.held
    # A site that has caught up takes any batch: a limit below a batch's size is no deadlock.
    if pending > 0 and pending + coming > limit:
        raise BacklogFullError(pending, limit)


def _check_robot(
    tx: Transaction, site: SiteLedger, name: str, coming: int, processed: int, limit: int
) -> None:
    """Leave room for the site's other robots, however fast this one sends."""
    robot = site.robots.get(name)
    if robot is None or site.position - processed + site.held + coming <= limit:
        return
    pending = tx.released_after(site, robot, processed) + robot.order.held
    if pending > 0 and pending + coming > limit:
        raise BacklogFullError(pending, limit, robot=name)


def set_mount(tx: Transaction, site_name: str, robot_name: str, mount: bytes | None) -> None:
    """Log a robot's mount (None: none) for the scans that follow, creating the robot.

    The same again changes nothing. What was accepted before is released first: it was taken with
    the old one.
    """
    site = tx.site(site_name)
    robot = tx.robot(site, robot_name)
    if robot.mount != mount:
        tx.release_scans(site, robot, all_held=True)
        tx.add_control(site, robot, "mount", mount)
        robot.mount = mount
        tx.connection.execute(
            update(tables.robots).where(tables.robots.c.id == robot.id).values(mount=mount)
        )


def forget_robot(tx: Transaction, site_name: str, robot_name: str) -> bool:
    """Log that a robot is forgotten; False where there is none of that name.

    Its name is free again, for a robot that starts anew.
    """
    site = tx.ledger.sites.get(site_name)
    robot = None if site is None else site.robots.get(robot_name)
    if site is None or robot is None:
        return False
    tx.release_scans(site, robot, all_held=True)
    for _, late in robot.order.pop_late():  # wherever they belong, they go with the robot
        tx.append_late(site, [entry for _, entry in late], in_order=False)
    tx.add_control(site, robot, "forget", None)
    bury(tx, "robot", site.id, str(robot.id))
    tx.connection.execute(
        update(tables.robots).where(tables.robots.c.id == robot.id).values(forgotten=True)
    )
    del site.robots[robot_name]
    site.changed.add(robot_name)
    return True


def act(
    tx: Transaction, site_name: str, robot_name: str, kind: ActionKind, claim: bytes
) -> int | None:
    """Log what an operator does to a robot's constraint; return the entry's position.

    claim: what it says, as `codec.encode_claim` has it. None where there is no such robot.
    """
    site = tx.ledger.sites.get(site_name)
    robot = None if site is None else site.robots.get(robot_name)
    if site is None or robot is None:
        return None
    tx.add_control(site, robot, kind, claim)
    return site.position


def configure(
    tx: Transaction, site_name: str, config: ConfigEntry, *, make: bool = False
) -> ConfigEntry | None:
    """Log what a site's map is made with, from its first scan on; return the entry in force.

    The same again is not logged. None where there is no such site and `make` is false.
    """
    site = tx.site(site_name) if make else tx.ledger.sites.get(site_name)
    if site is None:
        return None
    now = site.config
    if now is not None and (now.digest, now.own) == (config.digest, config.own):
        return now
    return tx.add_config(site, config)


def begin_sites_with(tx: Transaction, config: ConfigEntry | None) -> None:
    """Let the log of every site that this process makes from now on begin with this."""
    tx.ledger.first_config = config


def delete_site(tx: Transaction, site_name: str) -> int | None:
    """Forget a site and all its scans; return its id, None where there is none."""
    site = tx.ledger.sites.get(site_name)
    if site is None:
        return None
    tx.remove_site(site)
    bury(tx, "site", site.id, site.name)
    return site.id


def remove_file(tx: Transaction, site_id: int, kind: FileKind, name: str) -> bool:
    """Delete a file for good; False where there is none of that name."""
    gone = delete_file(tx, site_id, kind, name)
    if gone:
        bury(tx, kind, site_id, name)
    return gone


def delete_again(tx: Transaction, stone: Tombstone) -> None:
    """Delete what a tombstone is of, if a former copy has brought it back."""
    site = next((s for s in tx.ledger.sites.values() if s.id == stone.site_id), None)
    if site is None:
        return
    if stone.kind == "robot":
        again = [name for name, robot in site.robots.items() if str(robot.id) == stone.name]
        for name in again:
            forget_robot(tx, site.name, name)
    elif stone.kind != "site":
        delete_file(tx, site.id, stone.kind, stone.name)
    elif site.name == stone.name:
        tx.remove_site(site)


def purge_portion(tx: Transaction) -> bool:
    """Remove some rows of deleted sites; True while there are more."""
    connection = tx.connection
    site_id = connection.execute(
        select(tables.sites.c.id).where(tables.sites.c.deleted.is_(True)).limit(1)
    ).scalar()
    if site_id is None:
        return False
    c = tables.entries.c
    portion = select(c.id).where(c.site_id == site_id).limit(_PURGE_PORTION)
    gone = connection.execute(delete(tables.entries).where(c.id.in_(portion)))
    if gone.rowcount == 0 and not purge_chapters(connection, site_id):
        robots = select(tables.robots.c.id).where(tables.robots.c.site_id == site_id)
        connection.execute(delete(tables.streams).where(tables.streams.c.robot_id.in_(robots)))
        t = tables
        for table in (t.robots, t.skips, t.snapshots, t.events, t.views, t.files):
            connection.execute(delete(table).where(table.c.site_id == site_id))
        connection.execute(delete(tables.sites).where(tables.sites.c.id == site_id))
    return True


def release_due(tx: Transaction) -> None:
    """Release the scans that have waited long enough."""
    for site, robot in list(tx.ledger.waiting.values()):
        tx.release_scans(site, robot)


def record_skip(tx: Transaction, site_id: int, position: int, reason: str) -> None:
    """Note that an entry is not fed again. The first reason stands.

    The entry itself is not looked at: SQLite commits nothing that has met a damaged page.
    """
    tx.flush()
    c = tables.skips.c
    there = select(func.count()).where(c.site_id == site_id, c.position == position)
    if not tx.connection.execute(there).scalar():
        tx.connection.execute(
            insert(tables.skips).values(site_id=site_id, position=position, reason=reason)
        )


def append_events(tx: Transaction, site_id: int, batch: EventBatch, kept: int) -> None:
    """Keep the events of a view and forget those before the last `kept` batches."""
    if all(site.id != site_id for site in tx.ledger.sites.values()):
        return
    c = tables.events.c
    tx.connection.execute(
        insert(tables.events).values(
            site_id=site_id,
            number=batch.number,
            position=batch.position,
            version=batch.version,
            producer=batch.producer,
            body=batch.body,
        )
    )
    if batch.number % _FORGET_EVENTS_EVERY == 0:
        old = c.number <= batch.number - kept
        tx.connection.execute(delete(tables.events).where(c.site_id == site_id, old))
    notify(tx.connection, f"events {site_id}")


def save_view(connection: Connection, site_id: int, view: ViewRecord) -> None:
    """Keep a site's view and tell the other processes."""
    values = {"position": view.position, "data": view.data}
    c = tables.views.c
    there = connection.execute(update(tables.views).where(c.site_id == site_id).values(values))
    if not there.rowcount:
        connection.execute(insert(tables.views).values(site_id=site_id, **values))
    notify(connection, f"view {site_id}")


def begin_term(tx: Transaction) -> int:
    """Count another engine; what former ones write from now on is refused."""
    tx.connection.execute(update(tables.clock).values(term=tx.term + 1))
    drop_questions(tx.connection)
    return tx.term + 1
