"""The right to map a PostgreSQL database: a lock, and a lease that whoever holds it renews.

The lock ends with the session that holds it. A process that was stopped, or hangs, keeps its
session, and with it the lock, for ever: so the holder says something in that session every few
seconds, which the server notes. Where others see no news of it for too long, they end the session.
"""

from __future__ import annotations

import asyncio
import logging
from dataclasses import dataclass
from typing import Any

from sqlalchemy import text
from sqlalchemy.ext.asyncio import AsyncConnection

from lineloom_service.store.database import Claim

_LOG = logging.getLogger(__name__)

MAPPING_LOCK = 0x4C4C_0002
"""An advisory lock; it counts within one database."""

RENEW_S = 2.0
LOOK_S = 1.0
SILENT_LOOKS = 8
"""Counted in looks of the one who waits: a machine that was suspended is not taken for a hang."""

_ANSWER_S = 20.0
"""A database that does not answer for so long cannot be relied on to keep the lock."""

_LEASE = "SELECT 'lineloom maps'"
_RENEW = text(_LEASE)
_LOOK = text(
    "SELECT pid, application_name, query, state_change FROM pg_stat_activity"
    " JOIN pg_locks USING (pid)"
    f" WHERE locktype = 'advisory' AND granted AND objid = {MAPPING_LOCK}"
    " AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
)
_END = text("SELECT pg_terminate_backend(:pid)")


@dataclass(frozen=True, slots=True)
class Holder:
    """Who has the lock. sign: changes whenever its lease is renewed.

    renews: former versions do not, and are left alone.
    """

    pid: int
    name: str
    sign: Any
    renews: bool


async def look_for_holder(session: AsyncConnection) -> Holder | None:
    """Return who has the right to map, None where nobody has."""
    row = (await session.execute(_LOOK)).first()
    if row is None:
        return None
    # A server that keeps no statistics (track_activities) tells of no change at all.
    renews = row.query == _LEASE and row.state_change is not None
    return Holder(row.pid, row.application_name or "unknown", row.state_change, renews)


async def renew(session: AsyncConnection, claim: Claim) -> None:
    """Renew the lease until the session ends, or does not answer: then the claim is lost."""
    try:
        while True:
            async with asyncio.timeout(_ANSWER_S):
                await session.execute(_RENEW)
            await asyncio.sleep(RENEW_S)
    except Exception as error:
        _LOG.warning("the lease to map cannot be renewed: %s", type(error).__name__)
        claim.lost.set()


class HolderWatch:
    """What is known of the holder, from one look to the next."""

    def __init__(self) -> None:
        self._holder: Holder | None = None
        self._looks = 0
        self._silent = 0

    @property
    def trouble(self) -> str | None:
        """Why nobody seems to map; None where somebody does, or too little is known."""
        if self._looks == 0:
            return None
        if self._holder is None:
            return "no process maps what is taken"
        if self._silent > SILENT_LOOKS // 2:
            silence = self._silent * LOOK_S
            return f"the process that maps ({self._holder.name}) has been silent for {silence:g} s"
        return None

    def see(self, holder: Holder | None) -> None:
        """Take what a look has found."""
        same = holder is not None and holder == self._holder and holder.renews
        self._silent = self._silent + 1 if same else 0
        self._holder = holder
        self._looks += 1

    async def end_silent(self, session: AsyncConnection) -> None:
        """End the session of a holder that has been silent for too long."""
        if self._holder is not None and self._silent >= SILENT_LOOKS:
            _LOG.error("%s; its session is ended", self.trouble)
            await session.execute(_END, {"pid": self._holder.pid})
            self._holder, self._silent = None, 0
