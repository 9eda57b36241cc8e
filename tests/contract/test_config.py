"""The mapper's parameters of a site: told with what they mean, taken whole or not at all."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.parameters import by_name, effective
from lineloom_service.service import Service

from tests.contract.posting import expect_problem

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]


async def _remade(client: httpx.AsyncClient, site: str) -> dict[str, Any]:
    """Wait until there is nothing more to be made, and return the difference."""
    for _ in range(6000):
        told: dict[str, Any] = (await client.get(f"{site}/config/difference")).json()
        if (await client.get(site)).json()["remaking"] is None and "version" in told:
            return told
        await asyncio.sleep(0.01)
    raise AssertionError("never remade")


async def test_every_parameter_is_told(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle
) -> None:
    await client.post("/v1/sites/told/robots/a/scans", json=make_scan(0))
    await idle("told")
    answer = (await client.get("/v1/sites/told/config")).json()
    expected = dict(by_name(effective(MapperConfig())))
    assert answer["parameters"].keys() == expected.keys()
    assert answer["parameters"]["join.least_evidence"] == {
        "value": 20.0,
        "default": 20.0,
        "unit": "m",
        "meaning": expected["join.least_evidence"].meaning,
        "least": 0.0,
        "most": 1000.0,
        "choices": None,
    }
    matcher = answer["parameters"]["matcher"]
    assert (matcher["value"], matcher["choices"]) == ("lineloom", ["lineloom", "thesis"])
    assert (matcher["least"], matcher["most"], matcher["unit"]) == (None, None, "")
    assert (answer["own"], answer["position"], answer["remaking"]) == ({}, None, None)
    expect_problem(await client.get("/v1/sites/told/config/difference"), 404, "never-remade")
    expect_problem(await client.get("/v1/sites/nowhere/config"), 404, "unknown-site")


async def test_a_put_makes_the_map_anew(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle
) -> None:
    site = "/v1/sites/anew"
    await client.post(f"{site}/robots/a/scans", json={"scans": [make_scan(n) for n in range(5)]})
    before = await idle("anew")
    place = (await client.get(f"{site}/events?follow=false")).text.split("id: ")[-1].strip()
    put = await client.put(f"{site}/config", json={"join": {"least_set": 5}})
    assert put.status_code == 200, put.text
    answer = put.json()
    assert "made anew from the first scan" in answer["effect"]
    assert answer["own"] == {"join": {"least_set": 5}}
    assert answer["position"] == 6
    assert answer["parameters"]["join.least_set"]["value"] == 5
    told = await _remade(client, site)
    assert (told["type"], told["version"]) == ("remade", before["version"] + 1)
    assert told["robots"][0]["moved_m"] == 3.0  # as the fake mapper shows this parameter
    for _ in range(6000):  # events are told when they are on disk
        stream = await client.get(f"{site}/events?follow=false", headers={"Last-Event-ID": place})
        if "event: remade" in stream.text:
            break
        await asyncio.sleep(0.01)
    assert "event: remade" in stream.text

    again = await client.put(f"{site}/config", json={"join": {"least_set": 5}})
    assert again.json()["effect"].startswith("nothing")
    assert again.json()["position"] == 6


async def test_what_a_put_does_not_name_is_the_default(client: httpx.AsyncClient) -> None:
    site = "/v1/sites/partly/config"
    first = await client.put(site, json={"join": {"least_set": 5}, "chapter": 128})
    assert first.json()["effect"] == "they hold from the first scan on"
    second = (await client.put(site, json={"join": {"distinctive": 3}})).json()
    assert second["own"] == {"join": {"distinctive": 3}}
    changed = {n for n, p in second["parameters"].items() if p["value"] != p["default"]}
    assert changed == {"join.distinctive"}
    none = (await client.put(site, json={})).json()
    assert none["own"] == {}
    assert all(p["value"] == p["default"] for p in none["parameters"].values())


@pytest.mark.parametrize(
    ("body", "where", "reason"),
    [
        ({"chapter": 8, "join": {"least_sett": 3}}, "/join/least_sett", "not a parameter"),
        ({"chapter": 8, "join": {"least_set": 0}}, "/join/least_set", "from 1 to"),
        ({"chapter": 8, "join": {"least_set": "3"}}, "/join/least_set", "a number"),
        ({"chapter": 8, "matcher": "karto"}, "/matcher", "lineloom or thesis"),
        ({"chapter": 8, "tracker": 3}, "/tracker", "by name"),
        ({"chapter": 8, "persistence": {"near": 1}}, "/persistence/near", "persistence.far"),
        ([1], "", "by name"),
    ],
)
async def test_what_cannot_be_is_named_and_nothing_is_taken(
    client: httpx.AsyncClient, service: Service, body: object, where: str, reason: str
) -> None:
    problem = expect_problem(
        await client.put("/v1/sites/refused/config", json=body), 422, "invalid-body"
    )
    (error,) = problem["errors"]
    assert error["pointer"] == where
    assert reason in error["reason"]
    assert await service.store.site("refused") is None


async def test_all_that_is_wrong_in_a_body_is_named(client: httpx.AsyncClient) -> None:
    body = {"join": {"least_sett": 3, "least_set": 0, "distinctive": 2}, "chapter": "many"}
    problem = expect_problem(
        await client.put("/v1/sites/refused/config", json=body), 422, "invalid-body"
    )
    named = ["/join/least_sett", "/join/least_set", "/chapter"]
    assert [error["pointer"] for error in problem["errors"]] == named
    assert problem["detail"].endswith("(and 2 more)")
