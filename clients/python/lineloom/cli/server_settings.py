"""The settings of the service that is installed beside the client, for commands on its data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lineloom.cli.failure import CommandError


def server_settings(data_dir: Path | None) -> Any:
    """Return them, with another data directory if one is given.

    Raises CommandError where no service is installed, or where a setting is wrong.
    """
    try:
        from lineloom_service.settings import Settings
    except ImportError as error:
        raise CommandError(
            f"the service is not installed here ({error.name} is missing): "
            "`pip install lineloom-client[server]`"
        ) from None
    try:
        return Settings() if data_dir is None else Settings(data_dir=data_dir)
    except ValueError as error:
        raise CommandError(f"settings: {error}") from None
