"""A folder in which the docs' commands find what they name, and the programs that they call.

The programs are stand-ins as thin as can be: `lineloom serve` runs until it answers, then is asked
to stop; curl fails where the service refuses, and leaves a stream of events after some seconds;
make shows what it would do (the test suite is one of its targets).
"""

from __future__ import annotations

import gzip
import json
import os
import sys
from pathlib import Path

import numpy as np
import trustme
from ezdxf import units
from ezdxf.filemanagement import new
from lineloom.scan_like import to_wire
from lineloom_core.io.jsonl import ScanRecord, write_jsonl
from lineloom_core.scan import Scan
from lineloom_lab.simulation import Fleet, World, sick_lms200

from tests.core.io.bags import SCAN, Entry, Messages, write_bag
from tests.docs.pages import ROOT

_PROGRAMS = {
    "lineloom": """
        [[ "$1" == serve ]] && exec {python} -m tests.docs.serve_briefly "$@"
        exec {python} -m lineloom.cli "$@" """,
    "curl": """
        [[ " $* " == *" -sN "* ]] || exec /usr/bin/curl --fail-with-body --max-time 60 "$@"
        /usr/bin/curl --fail-with-body --max-time 2 "$@" || [[ $? == 28 ]]""",
    "make": """
        exec /usr/bin/make --dry-run --directory {root} "$@" """,
}


def furnish(folder: Path, world: World, scans: list[Scan]) -> None:
    """Make the programs and the files. scans: a robot's, for the files that hold one or several."""
    _programs(folder / ".venv" / "bin")
    (folder / "backup").mkdir()
    _json(folder, scans)
    _recordings(folder, Fleet.touring(world, robots=2, duration_s=5.0, lidar=sick_lms200()))
    _plan(folder / "building.dxf", world)
    _certificate(folder)


def environment(folder: Path, url: str, site: str) -> dict[str, str]:
    """Return the variables for a shell in the folder."""
    kept = {name: os.environ[name] for name in ("LANG", "TMPDIR") if name in os.environ}
    return kept | {
        "PATH": f"{folder / '.venv' / 'bin'}:{os.environ['PATH']}",
        "HOME": str(folder),
        "PYTHONPATH": str(ROOT),
        "LINELOOM_URL": url,
        "LINELOOM_SITE": site,
        "LINELOOM_WORKERS": "1",
    }


def _programs(folder: Path) -> None:
    folder.mkdir(parents=True)
    for name, text in _PROGRAMS.items():
        program = folder / name
        program.write_text("#!/bin/bash" + text.format(python=sys.executable, root=ROOT))
        program.chmod(0o755)


def _recordings(folder: Path, fleet: Fleet) -> None:
    drives = [[one.scan for one in robot.scans()] for robot in fleet.robots]
    monday, tuesday = (_carmen(scans) for scans in drives)
    for name in ("run.clf", "monday.clf"):
        (folder / name).write_text(monday)
    (folder / "tuesday.clf").write_text(tuesday)
    (folder / "run.log.gz").write_bytes(gzip.compress(monday.encode()))
    write_jsonl(folder / "run.jsonl", (ScanRecord(s.scan, s.robot) for s in fleet.scans()))
    messages = Messages("lone mcap")
    entries: list[Entry] = [
        (f"/r{number}/scan", SCAN, scan.stamp, _message(messages, scan))
        for number, scans in enumerate(drives, start=1)
        for scan in scans
    ]
    bag = write_bag(folder, "lone mcap", sorted(entries, key=lambda entry: entry[2]))
    for name in ("fleet.mcap", "monday.mcap"):
        (folder / name).write_bytes(bag.read_bytes())


def _carmen(scans: list[Scan]) -> str:
    lines = []
    for scan in scans:
        ranges = np.where(np.isfinite(scan.ranges), scan.ranges, 81.91)
        values = " ".join(f"{r:.3f}" for r in ranges)
        stamp = f"{scan.stamp:.3f}"
        lines.append(f"FLASER {len(ranges)} {values} 0 0 0 0 0 0 {stamp} robot {stamp}\n")
    return "".join(lines)


def _message(messages: Messages, scan: Scan) -> object:
    end = scan.angle_min + scan.angle_increment * (len(scan.ranges) - 1)
    fields = {"angle_min": scan.angle_min, "angle_max": end}
    fields |= {"angle_increment": scan.angle_increment, "range_max": scan.range_max}
    return messages.scan(scan.stamp, "base_link", scan.ranges, **fields)


def _json(folder: Path, scans: list[Scan]) -> None:
    wire = [to_wire(scan).model_dump(mode="json", exclude_none=True) for scan in scans]
    (folder / "scan.json").write_text(json.dumps(wire[0]))
    (folder / "scans.json.gz").write_bytes(gzip.compress(json.dumps({"scans": wire[1:]}).encode()))
    pair = {"reference": wire[0], "current": wire[5]}
    (folder / "pair.json").write_text(json.dumps(pair))


def _plan(path: Path, world: World) -> None:
    document = new("R2010", units=units.M)
    for x1, y1, x2, y2 in world.walls.tolist():
        document.modelspace().add_line((x1, y1), (x2, y2))
    document.saveas(path)


def _certificate(folder: Path) -> None:
    certificate = trustme.CA().issue_cert("localhost")
    (folder / "chain.pem").write_bytes(b"".join(c.bytes() for c in certificate.cert_chain_pems))
    certificate.private_key_pem.write_to_path(folder / "key.pem")
