"""The table of tokens, for `lineloom token` and for the service's guard."""

from __future__ import annotations

import time
from collections.abc import Sequence

from sqlalchemy import Connection, insert, select, update

from lineloom_service.security.token import SCOPES, Scope, TokenRecord, new_token
from lineloom_service.store.tables import tokens


class TokenRefusedError(ValueError):
    """What was asked for makes no sense; the text says why."""


def create_token(
    connection: Connection,
    scopes: Sequence[str],
    *,
    site: str | None = None,
    robot: str | None = None,
    note: str = "",
) -> tuple[str, TokenRecord]:
    """Make a token and return it: the only time that it can be seen. Raises TokenRefusedError."""
    wanted = _check_scopes(scopes)
    if robot and wanted != ("ingest",):
        raise TokenRefusedError("only a token whose one scope is ingest can be bound to a robot")
    if robot and not site:
        raise TokenRefusedError("a robot is named within a site: name the site as well")
    token, name, digest = new_token()
    record = TokenRecord(name, digest, wanted, site, robot, note, time.time())
    connection.execute(
        insert(tokens).values(
            id=record.id,
            digest=record.digest,
            scopes=" ".join(record.scopes),
            site=site,
            robot=robot,
            note=note,
            created=record.created,
        )
    )
    return token, record


def read_tokens(connection: Connection) -> list[TokenRecord]:
    """Return all tokens, revoked ones included, in the order made."""
    c = tokens.c
    query = select(
        c.id, c.digest, c.scopes, c.site, c.robot, c.note, c.created, c.revoked
    ).order_by(c.created, c.id)
    return [
        TokenRecord(name, digest, _read_scopes(scopes), *rest)
        for name, digest, scopes, *rest in connection.execute(query)
    ]


def revoke_token(connection: Connection, token_id: str) -> bool:
    """Make a token worthless for good. False where there is none of that id still good."""
    c = tokens.c
    done = connection.execute(
        update(tokens).where(c.id == token_id, c.revoked.is_(None)).values(revoked=time.time())
    )
    return done.rowcount > 0


def _check_scopes(scopes: Sequence[str]) -> tuple[Scope, ...]:
    unknown = [scope for scope in scopes if scope not in SCOPES]
    if unknown or not scopes:
        named = f"no scope {unknown[0]!r}" if unknown else "no scope named"
        raise TokenRefusedError(f"{named}; there are {', '.join(SCOPES)}")
    return tuple(scope for scope in SCOPES if scope in scopes)


def _read_scopes(text: str) -> tuple[Scope, ...]:
    held = text.split(" ")
    return tuple(scope for scope in SCOPES if scope in held)
