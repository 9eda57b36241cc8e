"""How patient a command is with the service."""

from __future__ import annotations

from lineloom.cli.console import note
from lineloom.client import Client
from lineloom.retry import RetryPolicy

_WARM_UP_S = 600.0


def quick() -> RetryPolicy:
    """Someone waits at the terminal: a service that is not there is told soon."""
    return RetryPolicy(attempts=3, first_delay=0.2)


def patient() -> RetryPolicy:
    """A file can wait: where the service is behind, the play goes on when it has caught up."""
    return RetryPolicy(attempts=100, max_delay=2.0, max_retry_after=120.0)


def require_ready(client: Client) -> None:
    """Raise ConnectionFailedError at once where nothing answers; let a service warm up."""
    if not client.ready().maps:
        note("The service is warming up; its first start on a machine compiles for a minute or so.")
        client.wait_until_ready(_WARM_UP_S, maps=True)
