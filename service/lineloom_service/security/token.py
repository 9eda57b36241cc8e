"""A bearer token: what its holder has, and what of it is stored.

Written `lineloom_<id>_<secret>`. The id is public and finds the row; of the secret only a SHA-256
digest is kept. It has 256 random bits, so there is nothing that a slow hash would make harder to
guess.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from dataclasses import dataclass
from typing import Literal, get_args

Scope = Literal["ingest", "read", "operate"]
SCOPES: tuple[Scope, ...] = get_args(Scope)

_FORM = re.compile(r"lineloom_([0-9a-f]{12})_([A-Za-z0-9_-]{43})")


@dataclass(frozen=True, slots=True)
class TokenRecord:
    """What is stored of a token. site: where it is bound to one. robot: where `ingest` is.

    created, revoked: seconds since 1970. note: the operator's own words.
    """

    id: str
    digest: str
    scopes: tuple[Scope, ...]
    site: str | None
    robot: str | None
    note: str
    created: float
    revoked: float | None = None

    def proves(self, secret: str) -> bool:
        """Whether this is the token's secret; takes the same time whatever the answer."""
        return hmac.compare_digest(digest(secret), self.digest)


def new_token() -> tuple[str, str, str]:
    """Return a new token, its id and its digest."""
    name, secret = secrets.token_hex(6), secrets.token_urlsafe(32)
    return f"lineloom_{name}_{secret}", name, digest(secret)


def parse_token(text: str) -> tuple[str, str] | None:
    """Return id and secret of what a client sent, None where it is no token."""
    found = _FORM.fullmatch(text)
    return None if found is None else (found[1], found[2])


def digest(secret: str) -> str:
    """Return what is stored of a secret."""
    return hashlib.sha256(secret.encode()).hexdigest()
