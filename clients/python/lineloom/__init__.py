"""Lineloom for robots and operators: send scans, ask for the map.

    from lineloom import Client, Outbox

    with Client("http://lineloom.local:8765") as client:
        client.post_scan("floor-2", "robot-7", scan)
        client.wait_until_idle("floor-2")
        svg = client.map_file("floor-2", "svg")

The contract's types are in `lineloom.wire`, the errors in `lineloom.errors`.
"""

from lineloom.async_client import AsyncClient
from lineloom.client import Client
from lineloom.errors import (
    AccessDeniedError,
    BusyError,
    ConflictError,
    ConnectionFailedError,
    InvalidRequestError,
    InvalidScanError,
    LineloomError,
    NotFoundError,
    NotIdleError,
    OutboxError,
    OutboxFullError,
    ProblemError,
    SequenceError,
    ServiceFailedError,
    TooSlowError,
    UnexpectedAnswerError,
)
from lineloom.outbox import AsyncOutbox, Outbox, OutboxStats
from lineloom.retry import RetryPolicy

__all__ = [
    "AccessDeniedError",
    "AsyncClient",
    "AsyncOutbox",
    "BusyError",
    "Client",
    "ConflictError",
    "ConnectionFailedError",
    "InvalidRequestError",
    "InvalidScanError",
    "LineloomError",
    "NotFoundError",
    "NotIdleError",
    "Outbox",
    "OutboxError",
    "OutboxFullError",
    "OutboxStats",
    "ProblemError",
    "RetryPolicy",
    "SequenceError",
    "ServiceFailedError",
    "TooSlowError",
    "UnexpectedAnswerError",
]
