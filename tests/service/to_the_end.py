"""A connection that is read until the service closes it."""

from __future__ import annotations

import socket


def to_the_end(wire: socket.socket) -> bytes:
    """Return all that comes until the service closes the connection."""
    received = b""
    try:
        while part := wire.recv(65_536):
            received += part
    except ConnectionResetError:  # it had not read all that was sent
        pass
    return received
