"""The outbox itself: numbering, delivery in the background, back-off."""

from __future__ import annotations

import secrets
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from typing_extensions import Self

from lineloom.client import Client
from lineloom.errors import (
    AccessDeniedError,
    BusyError,
    InvalidRequestError,
    LineloomError,
    NotIdleError,
)
from lineloom.outbox.queue import OnFull, OutboxStats, Queued, Refusal, ScanQueue
from lineloom.retry import RetryPolicy
from lineloom.scan_like import ScanLike, fields_of, to_wire
from lineloom.session import DEFAULT_BATCH
from lineloom.wire import RejectedScan


@dataclass(frozen=True, slots=True)
class DeliveryFailure:
    """Why the latest attempt did not get through, and how many failed in a row."""

    error: LineloomError
    in_a_row: int


class Outbox:
    """Scans of one robot, safe on disk until the service has them safe on its own.

    `put` returns when the scan is on disk. Delivery is at least once over the wire and, since
    the service knows scans by (session, seq), exactly once in effect: over network loss, lost
    answers, and `kill -9` of either side.

    path: the queue's file; one robot and one process each. session: None = a new one for every
    start (the counter begins at 0 and the service sees the restart); "persistent" = one for the
    life of the file, the counter goes on; anything else is taken literally. max_scans: bound on
    the file; on_full: "drop-oldest" (counted in `stats().dropped`) or "error" (`put` raises
    OutboxFullError). sync: each `put` survives a power cut (fsync), not only a crash.
    """

    def __init__(
        self,
        path: str | Path,
        client: Client,
        site: str,
        robot: str,
        *,
        session: str | None = None,
        max_scans: int = 100_000,
        on_full: OnFull = "drop-oldest",
        batch: int = DEFAULT_BATCH,
        sync: bool = True,
        retry: RetryPolicy | None = None,
    ) -> None:
        self.site = site
        self.robot = robot
        self._client = client
        self._batch = batch
        self._retry = RetryPolicy(first_delay=0.5, max_delay=30.0) if retry is None else retry
        self._queue = ScanQueue(path, max_scans=max_scans, on_full=on_full, sync=sync)
        self.session = self._begin(session)
        self._put_lock = threading.Lock()
        self._sending = threading.Lock()
        self._wake = threading.Event()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: DeliveryFailure | None = None

    def _begin(self, session: str | None) -> str:
        fresh = f"{time.time_ns() // 1_000_000:x}-{secrets.token_hex(3)}"
        if session == "persistent":
            return self._queue.fact("session", fresh)
        return fresh if session is None else session

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def put(self, scan: ScanLike) -> int:
        """Write a scan to disk and return its seq; a missing seq or session is filled in.

        The session "0", the contract's default, counts as missing. A scan that was put before
        (same session, seq and content) is counted and ignored. Raises InvalidScanError,
        SequenceError or OutboxFullError; never waits for the network.
        """
        fields = fields_of(scan)
        with self._put_lock:
            # A driver that leaves the default and counts from 0 at every start would otherwise
            # have its scans of today taken for those of yesterday.
            session = self.session if fields.get("session", "0") == "0" else fields["session"]
            seq = fields.get("seq")
            if seq is None:
                seq = self._queue.next_seq(session)
            self._queue.append(to_wire(fields, session=session, seq=seq))
        self._wake.set()
        return int(seq)

    def stats(self) -> OutboxStats:
        """Return the counts since the file was made."""
        return self._queue.stats()

    def refusals(self) -> list[Refusal]:
        """Return the latest scans that the service will never take, and why."""
        return self._queue.refusals()

    @property
    def failure(self) -> DeliveryFailure | None:
        """Why scans are waiting, or None where the latest attempt got through."""
        return self._failure

    def flush(self, timeout: float = 60.0) -> OutboxStats:
        """Deliver everything, backing off while the network is away.

        Raises NotIdleError with the reason after `timeout` seconds, AccessDeniedError at once;
        what is not delivered stays on disk.
        """
        deadline = time.monotonic() + timeout
        while True:
            pause = self._attempt()
            if pause is None:
                return self.stats()
            if self._failure is not None and isinstance(self._failure.error, AccessDeniedError):
                raise self._failure.error
            left = deadline - time.monotonic()
            if left <= 0.0:
                waiting = self.stats().pending
                reason = "" if self._failure is None else f": {self._failure.error}"
                raise NotIdleError(
                    f"{waiting} scans are still in the outbox after {timeout:g} s{reason}", waiting
                )
            time.sleep(min(pause, left))

    def start(self) -> None:
        """Deliver in the background from now on, until `close`."""
        if self._thread is not None:
            return
        self._thread = threading.Thread(
            target=self._run, name=f"lineloom-outbox-{self.robot}", daemon=True
        )
        self._thread.start()

    def close(self, timeout: float = 5.0) -> None:
        """Stop; wait up to `timeout` seconds for a delivery under way. The rest stays on disk."""
        self._stopping.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join(timeout)
            if self._thread.is_alive():
                # The thread still uses the file; it closes with the process.
                return
        self._queue.close()

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._wake.clear()
            pause = self._attempt()
            if pause is None:
                self._wake.wait()
            elif pause > 0.0:
                self._stopping.wait(pause)

    def _attempt(self) -> float | None:
        """Send one batch; return the pause before the next, None where nothing is left."""
        with self._sending:
            try:
                queued = self._queue.oldest(self._batch)
                if not queued:
                    return None
                self._deliver(queued)
            except LineloomError as error:
                return self._note(error)
            finally:
                self._queue.landed()
            self._failure = None
            return 0.0

    def _note(self, error: LineloomError) -> float:
        """Remember why it failed; return the pause before the next attempt."""
        in_a_row = 1 if self._failure is None else self._failure.in_a_row + 1
        self._failure = DeliveryFailure(error, in_a_row)
        pause = self._retry.pause(in_a_row - 1)
        if isinstance(error, BusyError) and error.retry_after is not None:
            return max(error.retry_after, pause)
        return pause

    def _deliver(self, queued: list[Queued]) -> None:
        scans = [entry.scan for entry in queued]
        try:
            answer = self._client.post_scans(self.site, self.robot, scans, batch=self._batch)
        except InvalidRequestError as error:
            # Something in the batch can never be taken: halve until it stands alone, so that it
            # does not hold up the rest for ever.
            if len(queued) == 1:
                refusal = RejectedScan(index=0, seq=scans[0].seq, reason=str(error))
                self._queue.settle(queued, [refusal])
                return
            middle = len(queued) // 2
            self._deliver(queued[:middle])
            self._deliver(queued[middle:])
            return
        self._queue.settle(queued, answer.rejected)
