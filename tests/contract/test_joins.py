"""An operator's word that two places are the same, and that a candidate is right."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest
import pytest_asyncio

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]

ENDS = {"robot_a": "a", "seq_a": 0, "robot_b": "alone", "seq_b": 0}


@pytest_asyncio.fixture(loop_scope="module")
async def url(client: httpx.AsyncClient, make_scan: Make, idle: Idle, site: str) -> str:
    """The constraints of a site with two robots that have met, and one that has not."""
    for robot in ("a", "b", "alone"):
        await client.post(f"/v1/sites/{site}/robots/{robot}/scans", json=make_scan(0))
    await idle(site)
    return f"/v1/sites/{site}/constraints"


async def test_a_join_is_made_undone_and_redone(client: httpx.AsyncClient, url: str) -> None:
    said = {**ENDS, "T_a_b": {"x": 0.5, "y": 0.25, "theta": 0.1}}
    made = await client.post(url, json=said)
    assert made.status_code == 201
    found = made.json()
    assert (found["kind"], found["state"]) == ("operator", "accepted")
    assert found["T_a_b"] == said["T_a_b"]
    listed = (await client.get(url, params={"kind": "operator"})).json()["constraints"]
    assert [c["id"] for c in listed] == [found["id"]]
    assert (await client.post(url, json=said)).json()["id"] == found["id"]
    gone = await client.post(f"{url}/{found['id']}/retract")
    assert gone.json()["state"] == "retracted"
    back = await client.post(f"{url}/{found['id']}/restore")
    assert back.json()["state"] == "accepted"


async def test_what_it_would_be_changes_nothing(client: httpx.AsyncClient, url: str) -> None:
    before = (await client.get(url)).json()
    found = await client.post(f"{url}/what-if", json={"robot_a": "a", "robot_b": "b"})
    assert found.status_code == 200
    trial = found.json()
    assert trial["T_a_b"] == {"x": 1.0, "y": 2.0, "theta": 0.5}
    assert trial["T_components"] is None
    assert trial["objections"] == ["walls stand in free space"]
    assert trial["limits"]["conflict"]["holds"]
    assert (await client.get(url)).json() == before
    apart = await client.post(f"{url}/what-if", json={**ENDS, "T_a_b": {"x": 0.0, "y": 0.0}})
    assert apart.json()["T_components"] == {"x": 3.0, "y": 4.0, "theta": 0.5}


async def test_without_a_pose_it_is_logged_as_the_matcher_found_it(
    client: httpx.AsyncClient, url: str
) -> None:
    found = (await client.post(url, json={"robot_a": "a", "robot_b": "b"})).json()
    assert found["T_a_b"] == {"x": 1.0, "y": 2.0, "theta": 0.5}


async def test_what_was_rejected_is_confirmed(client: httpx.AsyncClient, url: str) -> None:
    found = await client.post(f"{url}/k-rejected/confirm")
    assert found.status_code == 200
    assert (found.json()["kind"], found.json()["state"]) == ("operator", "accepted")
    again = await client.post(f"{url}/k-rejected/confirm")
    assert (again.status_code, again.json()["state"]) == (200, "accepted")
    await client.post(f"{url}/k0-2/retract")
    refused = await client.post(f"{url}/k0-2/confirm")
    assert refused.status_code == 409
    assert refused.json()["type"].endswith("retracted")
    assert (await client.post(f"{url}/nobody/confirm")).status_code == 404


@pytest.mark.parametrize(
    ("body", "status", "kind"),
    [
        ({"robot_a": "a", "seq_a": 0}, 422, "invalid-body"),
        ({**ENDS, "place_a": "p-x"}, 422, "invalid-body"),
        ({**ENDS, "robot_b": "a"}, 422, "invalid-body"),
        ({**ENDS, "T_a_b": {"x": "0", "y": 0}}, 422, "invalid-body"),
        ({**ENDS, "extra": 1}, 422, "invalid-body"),
        ({**ENDS, "robot_b": "nobody"}, 404, "unknown-robot"),
        ({**ENDS, "seq_b": 99}, 404, "unknown-scan"),
        ({"place_a": "p-x", "robot_b": "a"}, 404, "unknown-place"),
        ({"robot_a": "alone", "robot_b": "a"}, 409, "nothing-in-common"),
    ],
)
@pytest.mark.parametrize("call", ["", "/what-if"])
async def test_what_cannot_be_is_refused(
    client: httpx.AsyncClient, url: str, call: str, body: dict[str, Any], status: int, kind: str
) -> None:
    before = (await client.get(url)).json()
    refused = await client.post(url + call, json=body)
    assert refused.status_code == status, refused.text
    assert refused.json()["type"].endswith(kind)
    assert (await client.get(url)).json() == before
