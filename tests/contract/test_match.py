"""The stateless match: the real matcher, no mapper."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import numpy as np
import pytest
from lineloom import wire

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]


async def test_match(client: httpx.AsyncClient) -> None:
    angles = np.linspace(-np.pi / 2, np.pi / 2, 181)

    def seen_from(x: float, y: float) -> dict[str, Any]:
        """A room of 8 m by 6 m with its centre in the origin, and a step in one wall."""
        c, s = np.cos(angles), np.sin(angles)
        with np.errstate(divide="ignore"):
            across = np.where(c >= 0, (4.0 - x) / np.abs(c), (4.0 + x) / np.abs(c))
            along = np.where(s >= 0, (3.0 - y) / np.abs(s), (2.0 + y) / np.abs(s))
        return {
            "angle_min": float(angles[0]),
            "angle_increment": float(angles[1] - angles[0]),
            "range_min": 0.05,
            "range_max": 30.0,
            "ranges": np.minimum(across, along).tolist(),
        }

    body = {"reference": seen_from(0.0, 0.0), "current": seen_from(0.5, 0.2)}
    response = await client.post("/v1/match", json=body)
    assert response.status_code == 200
    answer = wire.MatchAnswer.model_validate_json(response.content)
    assert answer.verdict in ("match", "ambiguous")
    assert answer.T_reference_current is not None
    assert answer.T_reference_current.x == pytest.approx(0.5, abs=0.05)
    assert answer.T_reference_current.y == pytest.approx(0.2, abs=0.05)
    assert answer.pairs
    assert 0.0 <= answer.score <= 1.0


async def test_match_of_nothing(client: httpx.AsyncClient, make_scan: Make) -> None:
    empty = make_scan(0, ranges=["inf"] * 5)
    response = await client.post("/v1/match", json={"reference": empty, "current": empty})
    assert response.json()["verdict"] == "none"
    assert response.json()["reason"]
    for body, pointer in (
        ({"reference": empty}, "/current"),
        ({"reference": empty, "current": make_scan(0, ranges=[])}, "/current/ranges"),
        ({"reference": make_scan(0, range_max=0.01), "current": empty}, "/reference/range_max"),
        (
            {"reference": make_scan(0, angle_min=float("nan")), "current": empty},
            "/reference/angle_min",
        ),
        ([], ""),
    ):
        content = json.dumps(body).encode()
        headers = {"Content-Type": "application/json"}
        response = await client.post("/v1/match", content=content, headers=headers)
        assert response.status_code == 422, body
        assert pointer in [error["pointer"] for error in response.json()["errors"]]
