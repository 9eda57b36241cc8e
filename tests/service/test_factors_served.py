"""What a running service believes is what gtsam has: counted in its answers, in a real process."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import gtsam
import httpx
import numpy as np
import pytest
import pytest_asyncio
from lineloom_core.geometry import angle_difference
from lineloom_lab.simulation import Fleet, rooms, sick_lms200
from lineloom_service.app import create_app
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.service import Service
from lineloom_service.settings import Settings
from lineloom_service.store.actions import append_scans
from lineloom_service.store.codec import encode_scan
from lineloom_service.store.records import NewScan

SITE = "/v1/sites/s"

pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def client(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[httpx.AsyncClient]:
    """A service at rest whose worker has mapped two robots that met."""
    settings = Settings(data_dir=tmp_path_factory.mktemp("data"), gap_window_s=0.1)
    service = Service(settings, engine=LocalEngine(1, settle_after_s=0.2))
    await service.start()
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=50.0, lidar=sick_lms200())
    for sample in fleet.scans():
        scan = NewScan(sample.scan.session, sample.scan.seq, encode_scan(sample.scan))
        await service.store.write(append_scans, "s", sample.robot, [scan], processed=0, limit=10**9)
    transport = httpx.ASGITransport(create_app(service=service))
    try:
        async with httpx.AsyncClient(
            transport=transport, base_url="http://lineloom", timeout=60.0
        ) as client:
            async with asyncio.timeout(500.0):
                while not (await client.get(SITE)).json()["idle"]:
                    await asyncio.sleep(0.05)
            yield client
    finally:
        await service.stop()


async def _constraints(client: httpx.AsyncClient) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    cursor = ""
    while True:
        page = (await client.get(f"{SITE}/constraints?state=accepted&limit=500{cursor}")).json()
        found += page["constraints"]
        if page["next_cursor"] is None:
            return found
        cursor = f"&cursor={page['next_cursor']}"


async def test_every_accepted_constraint_is_a_factor_and_nothing_else_is(
    client: httpx.AsyncClient, tmp_path: Path
) -> None:
    site = (await client.get(SITE)).json()
    accepted = await _constraints(client)
    kinds = {kind: states.get("accepted", 0) for kind, states in site["constraints"].items()}
    assert Counter(c["kind"] for c in accepted) == Counter(kinds)
    assert min(kinds.values()) > 0
    assert len(site["components"]) == 1
    file = tmp_path / "graph.g2o"
    file.write_text((await client.get(f"{SITE}/graph?format=g2o")).text)
    graph, values = gtsam.readG2o(str(file), False)
    assert graph.size() == len(accepted) == sum(kinds.values())
    nodes = (await client.get(f"{SITE}/graph")).json()["nodes"]
    assert values.size() == len(nodes) == site["components"][0]["keyframes"]
    row = {node["id"]: i for i, node in enumerate(nodes)}
    read: list[Any] = [graph.at(i) for i in range(graph.size())]
    factors = {(*factor.keys(), factor.measured().x()): factor for factor in read}
    for c in accepted:
        factor = factors.pop((row[c["keyframe_a"]], row[c["keyframe_b"]], c["T_a_b"]["x"]))
        information = np.array(c["information"], float)
        np.testing.assert_allclose(
            factor.noiseModel().information(),
            information,
            rtol=1e-9,
            atol=1e-9 * np.abs(information).max(),
        )
    assert not factors


async def test_what_is_shown_at_rest_is_where_gtsam_can_do_no_better(
    client: httpx.AsyncClient, tmp_path: Path
) -> None:
    answer = await client.get(f"{SITE}/graph")
    assert answer.json()["graph"]["settled"] is True
    assert "settled" in answer.headers["ETag"]
    file = tmp_path / "graph.g2o"
    file.write_text((await client.get(f"{SITE}/graph?format=g2o")).text)
    graph, values = gtsam.readG2o(str(file), False)
    shown = answer.json()["nodes"]
    for i, node in enumerate(shown):
        pose = values.atPose2(i)
        assert (pose.x(), pose.y()) == pytest.approx((node["x"], node["y"]), abs=1e-12)
    kinds = {(e["source"], e["target"], e["x"]): e["kind"] for e in answer.json()["edges"]}
    robust = gtsam.NonlinearFactorGraph()
    robust.add(
        gtsam.PriorFactorPose2(0, values.atPose2(0), gtsam.noiseModel.Isotropic.Sigma(3, 1e-4))
    )
    cauchy = gtsam.noiseModel.mEstimator.Cauchy.Create(3.0)
    steps: Counter[bool] = Counter()
    for i in range(graph.size()):
        factor: Any = graph.at(i)
        a, b = (shown[k]["id"] for k in list(factor.keys()))
        tracked = kinds[a, b, factor.measured().x()] == "sequential"
        steps[tracked] += 1
        noise = factor.noiseModel()
        model = noise if tracked else gtsam.noiseModel.Robust.Create(cauchy, noise)
        robust.add(factor.cloneWithNewNoiseModel(model))
    assert min(steps.values()) > 0
    found = gtsam.GaussNewtonOptimizer(robust, values).optimize()
    for i in range(len(shown)):
        apart = values.atPose2(i).between(found.atPose2(i))
        assert np.hypot(apart.x(), apart.y()) < 1e-6
        assert abs(angle_difference(apart.theta(), 0.0)) < 1e-6
