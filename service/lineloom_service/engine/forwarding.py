"""Questions to mappers from processes that have none: through the store to the one that maps."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import uuid
from collections.abc import Awaitable, Callable
from typing import Any, Literal

from lineloom_core.codec import CodecError, decode, encode

from lineloom_service.engine.protocol import QuestionFailedError, WorkerDiedError
from lineloom_service.engine.questions import pack_question, unpack_answer, unpack_question
from lineloom_service.store.protocol import Store
from lineloom_service.store.questions import post_answer, post_question, read_question, take_answer
from lineloom_service.store.records import StoreError

_LOG = logging.getLogger(__name__)

_PATIENCE_S = 30.0
_LOOK_S = 2.0
"""How often an answer is looked for although no notice came: notices may be lost."""


_Outcome = Literal["answered", "failed", "died"]


class Forwarding:
    """Both ends of the line. answer: asks a mapper of this process."""

    def __init__(self, store: Store, answer: Callable[..., Awaitable[Any]]) -> None:
        self._store = store
        self._answer = answer
        self._waiting: dict[str, asyncio.Event] = {}
        self._answering: set[asyncio.Task[None]] = set()

    async def ask(self, site_id: int, question: str, *arguments: object) -> Any:
        """Have the process that maps answer. Raises QuestionFailedError, WorkerDiedError."""
        key = uuid.uuid4().hex
        news = self._waiting[key] = asyncio.Event()
        try:
            asked = pack_question(site_id, question, arguments)
            await self._store.write_apart(post_question, key, asked)
            async with asyncio.timeout(_PATIENCE_S):
                answer = await self._await_answer(key, news)
        except (TimeoutError, StoreError) as error:
            raise WorkerDiedError(None, "no engine has answered", killed=False) from error
        finally:
            del self._waiting[key]
        return await asyncio.to_thread(_read, question, answer)

    def on_answer(self, key: str) -> None:
        """There is an answer, perhaps to a question of this process."""
        news = self._waiting.get(key)
        if news is not None:
            news.set()

    def on_question(self, key: str) -> None:
        """Answer, as the process that maps."""
        task = asyncio.create_task(self._reply(key))
        self._answering.add(task)
        task.add_done_callback(self._answering.discard)

    async def _await_answer(self, key: str, news: asyncio.Event) -> bytes:
        while True:
            with contextlib.suppress(TimeoutError):
                # Not `wait_for`, which may lose the end of our patience.
                async with asyncio.timeout(_LOOK_S):
                    await news.wait()
            news.clear()
            answer = await self._store.write_apart(take_answer, key)
            if answer is not None:
                return answer

    async def _reply(self, key: str) -> None:
        try:
            question = await self._store.read(read_question, key)
            if question is None:
                return
            answer = await self._answered(question)
            await self._store.write_apart(post_answer, key, encode(answer))
        except StoreError:
            _LOG.exception("a forwarded question is not answered")

    async def _answered(self, data: bytes) -> tuple[_Outcome, bytes]:
        try:
            site_id, question, arguments = await asyncio.to_thread(unpack_question, data)
            answer = await self._answer(site_id, question, *arguments)
            return "answered", await asyncio.to_thread(encode, answer)
        except WorkerDiedError as error:
            return "died", error.reason.encode()
        except QuestionFailedError as error:
            return "failed", str(error).encode()
        except CodecError as error:
            _LOG.warning("a forwarded question is unreadable: %s", error)
            return "failed", f"unreadable question: {error}".encode()


def _read(question: str, data: bytes) -> Any:
    """The answer to a question; raises what became of it instead."""
    try:
        outcome, value = decode(data, tuple[_Outcome, bytes])
        if outcome == "answered":
            return unpack_answer(question, value)
    except CodecError as error:
        _LOG.warning("the answer to a forwarded question is unreadable: %s", error)
        raise QuestionFailedError(f"unreadable answer: {error}") from error
    reason = value.decode(errors="replace")
    if outcome == "failed":
        raise QuestionFailedError(reason)
    raise WorkerDiedError(None, reason, killed=False)
