"""How slowly a body may come: who sends less than a minimum must not hold a share of the memory."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator

from lineloom_service.errors import SLOW_BODY, ProblemError


async def paced(
    parts: AsyncIterator[bytes], patience_s: float, rate: float
) -> AsyncGenerator[bytes, None]:
    """Yield the parts of a body. Raises ProblemError (408) where they come too slowly.

    A sender may be `patience_s` behind `rate` [bytes/s]: so long may it pause, and what it sends
    above the rate makes up for pauses before, not for those to come. Only the time spent waiting
    for it counts, not what the service does with a part in between.
    """
    clock = asyncio.get_running_loop().time
    left = patience_s
    while True:
        began = clock()
        try:
            async with asyncio.timeout(left):
                part = await anext(parts, None)
        except TimeoutError:
            raise _too_slow(patience_s, rate) from None
        if part is None:
            return
        left = min(left - (clock() - began) + len(part) / rate, patience_s)
        yield part


def _too_slow(patience_s: float, rate: float) -> ProblemError:
    # The rest of the body is not read: the connection cannot be used again.
    return ProblemError(
        SLOW_BODY,
        f"the body fell {patience_s:g} s behind {rate:g} bytes a second; nothing of it was taken, "
        "send it again, on a slow link in smaller parts",
        headers={"Connection": "close"},
    )
