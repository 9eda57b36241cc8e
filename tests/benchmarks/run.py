"""`make bench`, or `python -m tests.benchmarks.run [--json] [--quick] [--no-http]`.

Prints every speed that the project promises, each beside a baseline measured in the same run: the
ratio means the same on every machine, the figure only on this one. No test depends on either.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from dataclasses import asdict
from pathlib import Path

from lineloom_core.warm_up.drive import warm_up

from tests.benchmarks.drives import driving
from tests.benchmarks.ingest import ingesting
from tests.benchmarks.map_files import occupancy
from tests.benchmarks.queries import queries
from tests.benchmarks.restart import restarting
from tests.benchmarks.row import Row, table
from tests.benchmarks.scans import DATA, csail
from tests.benchmarks.single_scans import extraction, matching
from tests.benchmarks.sizes import growth
from tests.benchmarks.soak import QUICK_SHARE, SHARE, soaking


def measure(data: Path, *, quick: bool, http: bool) -> list[Row]:
    """Measure everything, telling on stderr what is at work."""
    _tell("warming up")
    warm_up()
    _tell("features")
    rows = extraction(quick=quick)
    _tell("pairs of scans")
    rows += matching(data, quick=quick)
    _tell("sizes of maps")
    rows += growth(data, quick=quick)
    _tell("maps as files")
    rows += occupancy(quick=quick)
    if http:
        _tell("ingest")
        rows += ingesting(quick=quick)
        _tell("restart")
        rows += restarting(quick=quick)
        _tell("soak")
        rows += soaking(QUICK_SHARE if quick else SHARE)
    if not (data / "mit-csail").is_dir():
        _tell(f"no drives and no real pairs: {data} is missing")
        return rows
    _tell("drives")
    rows += driving(data, quick=quick, http=http)
    scans = csail(data, 300 if quick else None)
    if http and scans is not None:
        _tell("queries under load")
        rows += queries(scans, quick=quick)
    return rows


def as_json(rows: list[Row]) -> str:
    """The rows and the machine as one JSON document."""
    machine = {
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
        "machine": platform.machine(),
        "python": platform.python_version(),
    }
    listed = [asdict(row) | {"ratio": row.ratio, "reached": row.reached} for row in rows]
    return json.dumps({"machine": machine, "rows": listed}, indent=2, ensure_ascii=False)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    parser.add_argument("--quick", action="store_true", help="few scans: does it run at all?")
    parser.add_argument("--no-http", action="store_true", help="leave the service out")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the real data")
    options = parser.parse_args()
    rows = measure(options.data, quick=options.quick, http=not options.no_http)
    if options.json:
        print(as_json(rows))
        return
    print(table(rows))
    cores, load = os.cpu_count(), os.getloadavg()[0]
    print(f"\n{cores} cores, load {load:.1f}. Medians of CPU time; HTTP by the wall clock.")


def _tell(what: str) -> None:
    print(f"… {what}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
