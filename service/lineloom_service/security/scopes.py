"""Which scope a route asks for.

Whatever is not named here asks for `read` to look and for `operate` to change something: a new
route is never open by oversight.
"""

from __future__ import annotations

from lineloom_service.security.token import Scope

_BY_ROUTE: dict[tuple[str, str], Scope] = {
    ("POST", "/v1/sites/{site}/robots/{robot}/scans"): "ingest",
    ("PUT", "/v1/sites/{site}/robots/{robot}"): "ingest",
    # These take scans and keep nothing.
    ("POST", "/v1/sites/{site}/localize"): "read",
    ("POST", "/v1/match"): "read",
    ("POST", "/v1/sites/{site}/constraints/{constraint}/what-if"): "read",
    ("POST", "/v1/sites/{site}/constraints/what-if"): "read",
}


ABOUT_NO_SITE = ("/v1/match", "/v1/map-formats", "/v1/sites")
"""Routes for tokens of one site as well; the list of sites then has that one only."""


def scope_of(method: str, path: str) -> Scope:
    """Return the scope for a method and a route's path as declared, e.g. `/v1/sites/{site}`."""
    named = _BY_ROUTE.get((method, path))
    if named is not None:
        return named
    return "read" if method in ("GET", "HEAD", "OPTIONS") else "operate"
