"""Gives scans that came after their successors the places that they should have had."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import select

from lineloom_service.store import tables
from lineloom_service.store.feed_order import FeedOrder, Place, read_order
from lineloom_service.store.ledger import SiteLedger
from lineloom_service.store.sequencer import Stream
from lineloom_service.store.transaction import Transaction


def place_late(tx: Transaction, site_id: int) -> int:
    """Put all late scans of a site into the log, each behind its predecessor; return how many.

    One batch, however many they are: from the entry on that closes it the log is read so rewritten
    (`feed_order`), and the map is made of that. The order between robots stays the log's.
    """
    site = next((site for site in tx.ledger.sites.values() if site.id == site_id), None)
    if site is None or not site.late:
        return 0
    tx.flush()
    order = read_order(tx.connection, site.id, site.order)
    places: list[Place] = []
    for name, robot in site.robots.items():
        for stream, late in robot.order.pop_late():
            anchors = _anchors(tx, site, stream, [seq for seq, _ in late], order)
            positions = tx.append_late(site, [entry for _, entry in late], in_order=True)
            seqs = [seq for seq, _ in late]
            places += [
                (anchor, stream.id, seq, position)
                for anchor, seq, position in zip(anchors, seqs, positions, strict=True)
            ]
            site.changed.add(name)
    tx.add_order(site, sorted(places))
    return len(places)


def _anchors(
    tx: Transaction, site: SiteLedger, stream: Stream, seqs: Sequence[int], order: FeedOrder
) -> list[int]:
    """Return the positions that a session's late scans come behind; seqs: in order.

    That of the scan before it; where there is none, the one before the scan after it. A run of
    late ones without another in between comes behind the same.
    """
    c = tables.entries.c
    of_stream = (c.stream_id == stream.id) & c.position.is_not(None)
    query = select(c.seq, c.position).where(of_stream).limit(1)
    anchors: list[int] = []
    until: int | None = -1
    for seq in seqs:
        if until is not None and seq > until:
            before = tx.connection.execute(query.where(c.seq < seq).order_by(c.seq.desc())).first()
            after = tx.connection.execute(query.where(c.seq > seq).order_by(c.seq)).first()
            until = None if after is None else after.seq
            anchor = site.position
            if before is not None:
                anchor = order.anchor(before.position)
            elif after is not None:
                late = order.anchor(after.position) != after.position
                anchor = order.anchor(after.position) - (not late)
        anchors.append(anchor)
    return anchors
