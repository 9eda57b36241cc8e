"""What the ingest tests share: sending a body, and reading a problem."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]

JSON = {"Content-Type": "application/json"}
MSGPACK = {"Content-Type": "application/msgpack"}


async def post_scans(
    client: httpx.AsyncClient, site: str, body: Any, headers: dict[str, str] | None = None
) -> httpx.Response:
    """POST a body to robot "r" of a site; anything but bytes goes as JSON."""
    content = body if isinstance(body, bytes) else json.dumps(body).encode()
    return await client.post(
        f"/v1/sites/{site}/robots/r/scans", content=content, headers=headers or JSON
    )


def expect_problem(response: httpx.Response, status: int, slug: str) -> dict[str, Any]:
    """Assert a refusal with all that every problem must have; return its document."""
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = response.json()
    assert problem["type"] == f"/problems/{slug}"
    assert problem["status"] == status
    assert problem["title"]
    assert problem["detail"]
    return problem
