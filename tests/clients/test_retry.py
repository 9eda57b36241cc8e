"""Back-off: how long, how often, and what the service's own wish changes."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from lineloom.retry import RetryPolicy, parse_retry_after


def test_pauses_double_up_to_the_maximum_without_jitter() -> None:
    policy = RetryPolicy(first_delay=0.5, factor=2.0, max_delay=3.0, jitter=0.0)
    assert [policy.pause(n) for n in range(5)] == [0.5, 1.0, 2.0, 3.0, 3.0]
    assert policy.pause(100_000) == 3.0


def test_jitter_shortens_by_at_most_its_share_and_spreads() -> None:
    policy = RetryPolicy(first_delay=1.0, factor=1.0, jitter=0.5, seed=3)
    pauses = [policy.pause(0) for _ in range(200)]
    assert all(0.5 <= pause <= 1.0 for pause in pauses)
    assert max(pauses) - min(pauses) > 0.4
    again = RetryPolicy(first_delay=1.0, factor=1.0, jitter=0.5, seed=3)
    assert pauses == [again.pause(0) for _ in range(200)]


def test_the_last_attempt_is_the_last() -> None:
    policy = RetryPolicy(attempts=3)
    assert policy.after_failure(0) is not None
    assert policy.after_failure(1) is not None
    assert policy.after_failure(2) is None


@pytest.mark.parametrize("status", [408, 429, 502, 503, 504])
def test_passing_troubles_are_tried_again(status: int) -> None:
    assert RetryPolicy().after_status(0, status, None) is not None


@pytest.mark.parametrize("status", [200, 202, 304, 400, 401, 404, 409, 413, 422, 500, 501])
def test_other_answers_stand(status: int) -> None:
    assert RetryPolicy().after_status(0, status, None) is None


def test_retry_after_is_a_lower_bound() -> None:
    policy = RetryPolicy(first_delay=0.1, jitter=1.0)
    pauses = [policy.after_status(0, 429, 7.0) for _ in range(50)]
    assert all(pause is not None and 7.0 <= pause <= 7.1 for pause in pauses)


def test_a_longer_pause_than_allowed_is_left_to_the_caller() -> None:
    assert RetryPolicy(max_retry_after=60.0).after_status(0, 503, 61.0) is None


@pytest.mark.parametrize(
    ("header", "seconds"),
    [
        (None, None),
        ("12", 12.0),
        ("Wed, 01 Jan 2025 00:00:30 GMT", 30.0),
        ("Tue, 31 Dec 2024 23:59:00 GMT", 0.0),
        ("soon", None),
    ],
)
def test_retry_after_is_a_number_or_a_date(header: str | None, seconds: float | None) -> None:
    assert parse_retry_after(header, now=datetime(2025, 1, 1, tzinfo=UTC)) == seconds


def test_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match="attempts"):
        RetryPolicy(attempts=0)
    with pytest.raises(ValueError, match="jitter"):
        RetryPolicy(jitter=1.5)
