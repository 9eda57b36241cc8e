"""Whether the storage takes what comes, found out when somebody asks."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable

_GOOD_FOR_S = 2.0
"""A trial writes and waits for the disk: not for every one of many who ask."""


class StorageWatch:
    """Tries the storage at most once in a while, whoever asks how often."""

    def __init__(self, check: Callable[[], Awaitable[str | None]]) -> None:
        """check: returns why the storage takes nothing, None where it does."""
        self._check = check
        self._trial: asyncio.Task[str | None] | None = None
        self._looked = -_GOOD_FOR_S
        self.failure: str | None = None
        """What the last trial found."""

    async def look(self) -> str | None:
        """Return why nothing can be stored, None where all is well."""
        if self._trial is None and time.monotonic() - self._looked < _GOOD_FOR_S:
            return self.failure
        if self._trial is None:
            self._trial = asyncio.create_task(self._try())
        return await asyncio.shield(self._trial)  # others may wait for it as well

    async def _try(self) -> str | None:
        try:
            self.failure = await self._check()
        finally:
            self._looked, self._trial = time.monotonic(), None
        return self.failure
