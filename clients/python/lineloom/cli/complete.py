"""Names that the shell completes: the service is asked, and silence is no names."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable

import typer

from lineloom.client import Client
from lineloom.errors import LineloomError
from lineloom.retry import RetryPolicy

_PATIENCE_S = 2.0
"""Someone has pressed the tabulator key."""


def site_names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the sites whose names begin so."""
    return _ask(ctx, incomplete, lambda client: (s.site for s in client.sites().sites))


def robot_names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the robots of the site on the command line whose names begin so."""
    site = ctx.params.get("site") or os.environ.get("LINELOOM_SITE") or "default"
    return _ask(ctx, incomplete, lambda client: (r.robot for r in client.robots(site).robots))


def component_names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the components of the site on the command line whose names begin so."""
    site = ctx.params.get("site") or os.environ.get("LINELOOM_SITE") or "default"
    return _ask(ctx, incomplete, lambda client: (c.id for c in client.site(site).components))


def _ask(
    ctx: typer.Context, incomplete: str, names: Callable[[Client], Iterable[str]]
) -> list[str]:
    url, token = ctx.params.get("url"), ctx.params.get("token")
    try:
        with Client(url, token=token, retry=RetryPolicy(attempts=1), timeout=_PATIENCE_S) as client:
            return sorted(name for name in names(client) if name.startswith(incomplete))
    except LineloomError:
        return []  # a message would land in the middle of the line that is being written
