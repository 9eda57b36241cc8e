"""`python map_once.py DIRECTORY`: map a log with the mapper that is found, and say how it went."""

from __future__ import annotations

import asyncio
import json
import sys
from pathlib import Path

from lineloom_core.mapping.config import JoinConfig
from lineloom_lab.simulation import Fleet, rooms, sick_lms200
from lineloom_service.engine.conductor import Conductor
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.observation.durations import Histogram
from lineloom_service.settings import Settings
from lineloom_service.store.actions import append_scans
from lineloom_service.store.choice import database_at
from lineloom_service.store.codec import encode_scan
from lineloom_service.store.records import NewScan
from lineloom_service.store.sql_store import SqlStore


async def _map(directory: Path) -> dict[str, object]:
    settings = Settings(data_dir=directory, chunk=1000, snapshot_every=100_000)
    store = SqlStore(database_at(None, settings.database_path), gap_window_s=0.0, max_held=10_000)
    engine = LocalEngine(1, warm_up=None)
    conductor = Conductor(store, engine, settings)
    await store.open()
    if await store.site("site") is None:
        await _post(store)
    await conductor.start()
    record = await store.site("site")
    assert record is not None
    assert await conductor.reached(record.id, record.position, 300.0)
    while not (view := conductor.published(record.id).view).settled:
        await asyncio.sleep(0.02)
    met = [c.id for c in view.constraints if c.kind == "rendezvous"]
    evidence = await conductor.ask(record.id, "explain", met[0])
    mapped = engine.durations().stages.get("entry", Histogram())
    await conductor.stop()
    await store.close()
    return {
        "mapped": sum(mapped.counts),
        "gate": evidence.limits["set_evidence"].at_least,
        "fields": list(JoinConfig.__dataclass_fields__),
        "view": [view.version, [(line.id, line.x1, line.y2) for line in view.lines]],
    }


async def _post(store: SqlStore) -> None:
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=50.0, lidar=sick_lms200())
    for sample in fleet.scans():
        scan = NewScan(sample.scan.session, sample.scan.seq, encode_scan(sample.scan))
        await store.write(append_scans, "site", sample.robot, [scan], processed=0, limit=10**9)


if __name__ == "__main__":
    print(json.dumps(asyncio.run(_map(Path(sys.argv[1])))))
