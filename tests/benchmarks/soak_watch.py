"""Those who look on during the soak: at memory, at the backlog, and some who never read."""

from __future__ import annotations

import re
import socket
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import httpx

_EVERY_S = 1.0
_BUFFER_BYTES = 4096
_TAKEN = b"HTTP/1.1 200"


@dataclass(frozen=True, slots=True)
class Moment:
    """Resident memory of the API process and of each worker, beside how much map there is.

    keyframes: the places that the map rests on. saved_bytes: its snapshot, in which the raw scans
    kept for a while outweigh the rest at first: no measure of how the map grows.
    """

    when: str
    keyframes: int
    saved_bytes: int
    rss_bytes: dict[str, int]


def look(when: str, pid: int, keyframes: int, saved_bytes: int) -> Moment:
    """Look at the service whose API process has this id."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    processes = {"API": str(pid)} | {f"worker {k}": child for k, child in enumerate(children, 1)}
    return Moment(
        when, keyframes, saved_bytes, {name: _rss(child) for name, child in processes.items()}
    )


class SlowReaders:
    """Connections that ask for all events of a site and read none."""

    def __init__(self, port: int, site: str, count: int) -> None:
        self._sockets = [_listen(port, site) for _ in range(count)]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        for connection in self._sockets:
            connection.close()


class Watch:
    """Looks at the metrics once a second."""

    def __init__(self, url: str, site: str) -> None:
        self.highest_backlog = 0
        self._http = httpx.Client(base_url=url, timeout=60.0)
        self._backlog = f'lineloom_backlog_entries{{site="{site}"}}'
        self._keyframes = f'lineloom_keyframes{{site="{site}"}}'
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._over.set()
        self._thread.join()
        self._http.close()

    def listeners(self) -> int:
        """How many listen to events now."""
        return self._metric("lineloom_event_streams")

    def keyframes(self) -> int:
        """How many keyframes the map has now."""
        return self._metric(self._keyframes)

    def refused(self) -> int:
        """How many POSTs were answered 429."""
        return self._metric('lineloom_requests_refused_total{reason="backlog-full"}')

    def _watch(self) -> None:
        while not self._over.wait(_EVERY_S):
            self.highest_backlog = max(self.highest_backlog, self._metric(self._backlog))

    def _metric(self, name: str) -> int:
        text = self._http.get("/metrics").raise_for_status().text
        found = re.search(rf"^{re.escape(name)} (\S+)$", text, re.MULTILINE)
        return 0 if found is None else int(float(found[1]))


def _rss(pid: str) -> int:
    status = Path(f"/proc/{pid}/status").read_text()
    return 1024 * int(status.partition("VmRSS:")[2].split()[0])


def _listen(port: int, site: str) -> socket.socket:
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
    connection.connect(("127.0.0.1", port))
    connection.sendall(f"GET /v1/sites/{site}/events HTTP/1.1\r\nHost: x\r\n\r\n".encode())
    answer = connection.recv(len(_TAKEN), socket.MSG_WAITALL)
    if answer != _TAKEN:
        raise RuntimeError(f"a listener was answered {answer!r}")
    return connection
