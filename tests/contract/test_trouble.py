"""A site that cannot be mapped just now says why, and is well again afterwards."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import httpx
import pytest
import sqlalchemy as sa
from lineloom_service.engine import site_runner
from lineloom_service.store import tables
from lineloom_service.store.reads import read_feed
from lineloom_service.store.records import LogEntry, StoreError

pytestmark = pytest.mark.asyncio(loop_scope="module")

SITE = "/v1/sites/troubled"


async def _until(client: httpx.AsyncClient, done: Callable[[dict[str, Any]], bool]) -> Any:
    for _ in range(3000):
        site = (await client.get(SITE)).json()
        if done(site):
            return site
        await asyncio.sleep(0.02)
    raise AssertionError(f"never happened; last seen {site}")


async def test_why_a_site_is_not_mapped(
    client: httpx.AsyncClient,
    make_scan: Callable[..., dict[str, Any]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def broken(connection: sa.Connection, site_id: int, *position: Any) -> list[LogEntry]:
        name = sa.select(tables.sites.c.name).where(tables.sites.c.id == site_id)
        if connection.execute(name).scalar() == "troubled":
            raise StoreError("the storage failed: DatabaseError")
        return read_feed(connection, site_id, *position)

    with monkeypatch.context() as broken_store:
        broken_store.setattr(site_runner, "read_feed", broken)
        for site in ("troubled", "sound"):
            await client.post(f"/v1/sites/{site}/robots/r/scans", json=make_scan(0))
        site = await _until(client, lambda site: site["trouble"] is not None)
        assert site["trouble"] == "its log cannot be read: the storage failed: DatabaseError"
        assert not site["idle"]
        assert site["scans"]["pending"] == 1
        everything = (await client.get("/v1/sites")).json()["sites"]
        assert [s["site"] for s in everything if s["trouble"]] == ["troubled"]
    site = await _until(client, lambda site: site["idle"])
    assert site["trouble"] is None
