"""How large the head of a request may be: uvicorn's fastest protocol itself takes any."""

from __future__ import annotations

from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from lineloom_service.errors import HEAD_TOO_LARGE, problem_response

MOST_BYTES = 64 * 1024
MOST_FIELDS = 100


class _HeadTooLargeError(Exception):
    """Ends the parser's work on a head."""


class BoundedHeads(HttpToolsProtocol):
    """One connection, on which no more is kept of a head than it may have.

    Counted is what comes and is no body, so that a line that never ends counts as well, and the
    head of the next request while this one is answered. What came in one piece with the end of a
    head is counted by its fields.
    """

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._coming = self._fields = self._kept = 0

    def data_received(self, data: bytes) -> None:
        """Read on, unless there is too much that is no body."""
        self._coming += len(data)
        super().data_received(data)
        if self._coming > MOST_BYTES and not self.transport.is_closing():
            self._refuse()

    def on_message_begin(self) -> None:
        """Count anew."""
        self._fields = self._kept = 0
        super().on_message_begin()

    def on_url(self, url: bytes) -> None:
        """Take a piece of the address."""
        self._keep(len(url))
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Take a field, also one that comes after a body."""
        self._fields += 1
        self._keep(len(name) + len(value))
        super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """What comes now is body, or another head."""
        self._coming = 0
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Take a piece of the body."""
        self._coming = 0
        super().on_body(body)

    def send_400_response(self, msg: str) -> None:
        """Say what is wrong, where that is a head's size."""
        if self._kept > MOST_BYTES or self._fields > MOST_FIELDS:
            self._refuse()
        else:
            super().send_400_response(msg)

    def _keep(self, size: int) -> None:
        self._kept += size
        if self._kept > MOST_BYTES or self._fields > MOST_FIELDS:
            raise _HeadTooLargeError

    def _refuse(self) -> None:
        # In the midst of another request's answer there is no room for this one.
        if self.cycle is None or self.cycle.response_complete:
            self.transport.write(_ANSWER)
        self.transport.close()


def _answer() -> bytes:
    detail = f"a request's head may have {MOST_BYTES} bytes and {MOST_FIELDS} fields"
    response = problem_response(HEAD_TOO_LARGE, detail, headers={"Connection": "close"})
    fields = b"".join(b"%s: %s\r\n" % field for field in response.raw_headers)
    return b"HTTP/1.1 431 Request Header Fields Too Large\r\n%s\r\n%s" % (fields, response.body)


_ANSWER = _answer()
