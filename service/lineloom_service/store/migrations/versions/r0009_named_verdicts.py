"""Retractions named by the scans that they rest on; until now the log numbered keyframes."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator

import sqlalchemy as sa
from alembic import op
from lineloom_core.mapping.belief.claim import Claim

from lineloom_service.store.codec import encode_claim
from lineloom_service.store.migrations.former_verdicts import meanings

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None

_LOG = logging.getLogger(__name__)

_UNKNOWN = (
    "site %d: no snapshot knows %s, which its log names: it is looked for by number, and may be "
    "another constraint than was meant"
)

_entries = sa.table(
    "entries",
    *(sa.column(name) for name in ("id", "site_id", "kind", "position")),
    sa.column("body", sa.LargeBinary),
)
_snapshots = sa.table(
    "snapshots", sa.column("site_id"), sa.column("position"), sa.column("data", sa.LargeBinary)
)


def upgrade() -> None:
    """Write what every action was about, as far as a snapshot knows it; the others stay."""
    connection, e = op.get_bind(), _entries.c
    query = sa.select(e.id, e.site_id, e.body).where(e.kind.in_(("retract", "restore")))
    by_site: dict[int, list[tuple[int, str]]] = {}
    for number, site, body in connection.execute(query.order_by(e.site_id, e.position)):
        if body is not None and body[:1].isalpha():  # a name; a list of msgpack begins with none
            by_site.setdefault(site, []).append((number, body.decode()))
    for site, actions in by_site.items():
        snapshots = list(_snapshots_of(connection, site))
        for number, name in actions:
            told = _first(meaning(name) for meaning in snapshots)
            if told is None:
                _LOG.warning(_UNKNOWN, site, name)
                continue
            body = encode_claim(told) if isinstance(told, Claim) else told.encode()
            connection.execute(sa.update(_entries).where(e.id == number).values(body=body))


def downgrade() -> None:
    """Leave the log as it is: no code of revision 0008 numbers as the first one did."""


def _first(found: Iterable[Claim | str | None]) -> Claim | str | None:
    """What a constraint said, from wherever it is known; else its id."""
    known = [told for told in found if told is not None]
    return next((told for told in known if isinstance(told, Claim)), known[0] if known else None)


def _snapshots_of(
    connection: sa.Connection, site: int
) -> Iterator[Callable[[str], Claim | str | None]]:
    """What the snapshots of a site know of a name, the newest first."""
    s = _snapshots.c
    query = sa.select(s.data).where(s.site_id == site).order_by(s.position.desc())
    for (data,) in connection.execute(query).all():
        try:
            yield meanings(data)
        except ValueError as error:
            _LOG.warning("site %d: a snapshot is not read: %s", site, error)
