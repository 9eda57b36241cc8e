"""When to send again, and after how long."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from datetime import datetime, timezone
from email.utils import parsedate_to_datetime
from http import HTTPStatus

RETRIED_STATUSES = frozenset(
    {
        HTTPStatus.REQUEST_TIMEOUT,
        HTTPStatus.TOO_MANY_REQUESTS,
        HTTPStatus.BAD_GATEWAY,
        HTTPStatus.SERVICE_UNAVAILABLE,
        HTTPStatus.GATEWAY_TIMEOUT,
        HTTPStatus.INSUFFICIENT_STORAGE,
    }
)
"""Answers that a later attempt may not get. Every call of the contract may be sent twice."""


@dataclass
class RetryPolicy:
    """Exponential back-off with jitter; `Retry-After` is honoured.

    attempts: how often a call is sent at most; 1 = never again. first_delay, factor, max_delay:
    the n-th pause is min(first_delay * factor^n, max_delay) seconds. jitter: share of a pause
    that is random, so that robots which lost the network together do not come back together.
    max_retry_after: where the service asks for a longer pause than this, the error is raised
    instead and the caller decides. seed: makes the jitter repeatable.
    """

    attempts: int = 6
    first_delay: float = 0.2
    factor: float = 2.0
    max_delay: float = 10.0
    jitter: float = 0.5
    max_retry_after: float = 60.0
    seed: int | None = None
    _random: random.Random = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.attempts < 1:
            raise ValueError("attempts must be at least 1")
        if not 0.0 <= self.jitter <= 1.0:
            raise ValueError("jitter must lie between 0 and 1")
        self._random = random.Random(self.seed)

    def pause(self, attempt: int) -> float:
        """Return how long to wait [s] after the failed attempt, counted from 0."""
        # The exponent is bounded because an outbox goes on for days: 2.0**2000 overflows.
        pause = min(self.first_delay * self.factor ** min(attempt, 64), self.max_delay)
        return pause * (1.0 - self.jitter * self._random.random())

    def after_failure(self, attempt: int) -> float | None:
        """Return the pause after a lost connection [s], or None to give up."""
        return self.pause(attempt) if attempt + 1 < self.attempts else None

    def after_status(self, attempt: int, status: int, retry_after: float | None) -> float | None:
        """Return the pause after an answer [s], or None where the answer stands."""
        if status not in RETRIED_STATUSES or attempt + 1 >= self.attempts:
            return None
        if retry_after is None:
            return self.pause(attempt)
        if retry_after > self.max_retry_after:
            return None
        # Never earlier than asked; a little later, so that not all come at the same instant.
        return retry_after + self.jitter * self._random.random() * self.first_delay


def parse_retry_after(value: str | None, now: datetime | None = None) -> float | None:
    """Return the seconds a `Retry-After` header asks for (a number or an HTTP date)."""
    if value is None:
        return None
    if value.strip().isdigit():
        return float(value)
    try:
        moment = parsedate_to_datetime(value)
    except ValueError:
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=timezone.utc)
    return max(0.0, (moment - (now or datetime.now(timezone.utc))).total_seconds())
