"""What was rendered from a published view, kept for whoever asks for the same again."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable, Hashable
from contextlib import AbstractAsyncContextManager, nullcontext


class RenderCache:
    """Least recently used goes first, so that at most `limit` bytes are kept.

    Rendering runs on threads. Who asks for what is being rendered already waits for that.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._size = 0
        self._ready: OrderedDict[Hashable, bytes] = OrderedDict()
        self._under_way: dict[Hashable, asyncio.Task[bytes]] = {}

    @property
    def size(self) -> int:
        """Bytes kept."""
        return self._size

    async def get(
        self, key: Hashable, render: Callable[[], str | bytes], turn: asyncio.Lock | None = None
    ) -> bytes:
        """Return what `render` returns, or has returned for the same key.

        turn: held while it renders, where that is not to happen beside something else.
        """
        ready = self._ready.get(key)
        if ready is not None:
            self._ready.move_to_end(key)
            return ready
        task = self._under_way.get(key)
        if task is None:
            task = asyncio.create_task(self._render(key, render, turn or nullcontext()))
            self._under_way[key] = task
        # Who goes away takes nothing from the others who wait.
        return await asyncio.shield(task)

    async def _render(
        self,
        key: Hashable,
        render: Callable[[], str | bytes],
        turn: AbstractAsyncContextManager[None],
    ) -> bytes:
        try:
            async with turn:
                content = await asyncio.to_thread(render)
        finally:
            del self._under_way[key]
        data = content.encode() if isinstance(content, str) else content
        self._keep(key, data)
        return data

    def _keep(self, key: Hashable, data: bytes) -> None:
        if len(data) > self._limit:
            return
        self._ready[key] = data
        self._size += len(data)
        while self._size > self._limit:
            _, oldest = self._ready.popitem(last=False)
            self._size -= len(oldest)
