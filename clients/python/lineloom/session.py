"""What the sync and the async client have in common: settings, and when to send again."""

from __future__ import annotations

import importlib.metadata
from dataclasses import dataclass, field
from typing import Any, TypeVar

import httpx

from lineloom.address import is_loopback, service_token, service_url
from lineloom.calls import Call, Encoding, retry_after
from lineloom.errors import ConnectionFailedError, NotIdleError
from lineloom.retry import RetryPolicy
from lineloom.wire import IngestAnswer, Site

DEFAULT_BATCH = 200
"""Scans in one POST, where the caller does not say."""

_T = TypeVar("_T")


@dataclass
class Session:
    """Where and how to talk to the service."""

    url: str
    token: str | None
    encoding: Encoding
    compress: bool
    retry: RetryPolicy = field(repr=False)
    timeout: float

    @staticmethod
    def build(
        url: str | None,
        token: str | None,
        encoding: Encoding,
        compress: bool | None,
        retry: RetryPolicy | None,
        timeout: float,
    ) -> Session:
        """Fill in what was left open from the environment and the address."""
        address = service_url(url)
        try:
            parsed = httpx.URL(address)
            if parsed.scheme not in ("http", "https") or not parsed.host:
                raise httpx.InvalidURL("an address begins with http:// or https://")
            local = is_loopback(address)
        except httpx.InvalidURL as error:
            raise ConnectionFailedError(address, str(error), 1) from None
        return Session(
            url=address,
            token=service_token(token),
            encoding=encoding,
            # Compressing costs more than it saves where there is no network in between.
            compress=not local if compress is None else compress,
            retry=RetryPolicy() if retry is None else retry,
            timeout=timeout,
        )

    def http_options(self) -> dict[str, Any]:
        """Return the keyword arguments of both kinds of httpx client."""
        version = importlib.metadata.version("lineloom-client")
        headers = {"User-Agent": f"lineloom-python/{version}", "Accept": "application/json, */*"}
        if self.token is not None:
            headers["Authorization"] = f"Bearer {self.token}"
        return {
            "base_url": self.url,
            "headers": headers,
            "timeout": httpx.Timeout(self.timeout, connect=min(self.timeout, 10.0)),
            # A proxy from the environment must not stand before a service on this machine.
            "trust_env": not is_loopback(self.url),
        }

    def request_options(self, call: Call[Any]) -> dict[str, Any]:
        """Return the keyword arguments of `httpx.Client.request`."""
        return {
            "method": call.method,
            "url": call.path,
            "params": dict(call.params) or None,
            "headers": dict(call.headers),
            "content": call.content,
            # The map of a component that was merged answers with its survivor's address.
            "follow_redirects": call.method == "GET",
        }

    def after_failure(self, call: Call[Any], attempt: int, error: httpx.TransportError) -> float:
        """Return the pause before the next attempt, or raise ConnectionFailedError."""
        hopeless = isinstance(error, (httpx.UnsupportedProtocol, httpx.LocalProtocolError))
        pause = None if hopeless or not call.retried else self.retry.after_failure(attempt)
        if pause is None:
            reason = str(error) or type(error).__name__
            raise ConnectionFailedError(self.url, reason, attempt + 1) from error
        return pause

    def after_answer(self, call: Call[Any], attempt: int, response: httpx.Response) -> float | None:
        """Return the pause before the next attempt, or None where the answer stands."""
        if not call.retried:
            return None
        return self.retry.after_status(attempt, response.status_code, retry_after(response))


class BatchTotal:
    """Adds up the answers to the batches of one long list of scans."""

    def __init__(self) -> None:
        self._sent = 0
        self._answer = IngestAnswer(accepted=0, duplicates=0, rejected=[], pending=0)

    def add(self, answer: IngestAnswer, sent: int) -> None:
        """Add an answer; a rejected scan's index becomes its place in the whole list."""
        total = self._answer
        moved = [
            scan.model_copy(update={"index": scan.index + self._sent}) for scan in answer.rejected
        ]
        self._answer = IngestAnswer(
            accepted=total.accepted + answer.accepted,
            duplicates=total.duplicates + answer.duplicates,
            rejected=[*total.rejected, *moved],
            pending=answer.pending,
            suggested_rate_hz=answer.suggested_rate_hz,
        )
        self._sent += sent

    @property
    def answer(self) -> IngestAnswer:
        """The sum; `pending` and `suggested_rate_hz` are the latest ones."""
        return self._answer


def not_idle(site: Site, timeout: float) -> NotIdleError:
    """Return the error of a wait that took too long."""
    return NotIdleError(
        f"site {site.site} is not idle after {timeout:g} s: "
        f"{site.scans.pending} scans are not yet in the map",
        pending=site.scans.pending,
    )


def not_ready(url: str, timeout: float, reasons: list[str]) -> NotIdleError:
    """Return the error of a service that does not get ready."""
    return NotIdleError(f"{url} is not ready after {timeout:g} s: {'; '.join(reasons)}")
