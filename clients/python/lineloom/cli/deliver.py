"""A file that was fetched: to where it was asked for."""

from __future__ import annotations

import sys
from pathlib import Path

from lineloom.cli.console import note
from lineloom.cli.failure import CommandError, Exit


def refuse_terminal(output: Path | None, *, binary: bool, example: str) -> None:
    """End the command before it asks anybody, where bytes would go to a terminal."""
    if output is None and binary and sys.stdout.isatty():
        raise CommandError(f"this is not for the terminal: add --output {example}", Exit.USAGE)


def deliver(content: bytes, output: Path | None) -> None:
    """Write to a file, or to stdout and nothing else."""
    if output is None:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
        return
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_bytes(content)
    note(f"{output}: {len(content)} bytes")
