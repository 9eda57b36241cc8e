"""Where the commands write: results to stdout, everything else to stderr."""

from __future__ import annotations

import json
from typing import Any

from rich.console import Console

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)


def print_json(value: Any) -> None:
    """Print a result for scripts: one JSON document on stdout, nothing else."""
    # Not through rich: it would wrap long lines to the width of the terminal.
    print(json.dumps(value, indent=2))


def note(text: str) -> None:
    """Tell the user something that is not the result."""
    err.print(text, markup=False, soft_wrap=True)
