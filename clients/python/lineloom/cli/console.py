"""Where the commands write: results to stdout, everything else to stderr."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)
_LINE_S = 5.0


def print_json(value: Any) -> None:
    """Print a result for scripts: one JSON document on stdout, nothing else."""
    # Not through rich: it would wrap long lines to the width of the terminal.
    print(json.dumps(value, indent=2))


def note(text: str) -> None:
    """Tell the user something that is not the result."""
    err.print(text, markup=False, soft_wrap=True)


@contextmanager
def waiting(what: str) -> Iterator[Callable[[str], None]]:
    """Show what is waited for: a line that changes on a terminal, else one every few seconds."""
    if err.is_terminal:
        with err.status(f"{what} …") as status:
            yield lambda reason: status.update(f"{what}: {reason}")
        return
    told = float("-inf")

    def tell(reason: str) -> None:
        nonlocal told
        if time.monotonic() - told >= _LINE_S:
            told = time.monotonic()
            note(f"{what}: {reason}")

    yield tell
