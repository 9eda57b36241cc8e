"""Coverage-guided fuzzing of the ingest body, by atheris (optional; `pip install atheris`).

    python -m tests.fuzz.fuzz_ingest -max_total_time=60 [FOLDER]

From bytes to log entries: decompression, JSON and msgpack, every check. Anything but a scan taken
or a refusal that names its reason ends the run; libFuzzer writes the bytes to `crash-…`. FOLDER
keeps what was found to reach new code; it begins with a few bodies that are right.
"""

from __future__ import annotations

import asyncio
import gzip
import json
import sys
import tempfile
from pathlib import Path

import atheris
import msgpack

with atheris.instrument_imports(include=["lineloom", "lineloom_service", "lineloom_core.scan"]):
    from lineloom_service.body_budget import LEASE, BodyBudget, BodyLease
    from lineloom_service.errors import ProblemError
    from lineloom_service.intake import take_in
    from lineloom_service.request_body import read_body
    from lineloom_service.settings import Settings
    from starlette.requests import Request

_SETTINGS = Settings(max_body_bytes=1 << 20)
_BUDGET = BodyBudget(1 << 62)
_TYPES = (b"application/json", b"application/msgpack")
_REFUSED = {400, 413, 415, 422}


def try_one(data: bytes) -> None:
    """Take one body in; its first byte says how it comes."""
    if not data:
        return
    headers = [(b"content-type", _TYPES[data[0] & 1])]
    if data[0] & 2:
        headers.append((b"content-encoding", b"gzip"))

    async def receive() -> dict[str, object]:
        return {"type": "http.request", "body": data[1:], "more_body": False}

    scope = {"type": "http", "method": "POST", "headers": headers, LEASE: BodyLease(_BUDGET)}
    request = Request(scope, receive)
    try:
        _RUNNER.run(_take(request))
    except ProblemError as problem:
        if problem.kind.status not in _REFUSED or not problem.detail:
            raise RuntimeError("a refusal that is none") from problem


async def _take(request: Request) -> None:
    intake = await take_in(await read_body(request, _SETTINGS), 1000)
    assert intake.scans
    assert all(rejected.reason for rejected in intake.rejected)


def _sow(folder: Path) -> None:
    """Write right bodies of every form."""
    scan = {
        **{"seq": 3, "session": "a", "stamp": 1.5, "angle_min": -0.1, "angle_increment": 0.1},
        **{"range_min": 0.1, "range_max": 30.0, "ranges": [1.0, None, "inf"], "angle_max": 0.1},
        **{"time_increment": 0.0, "scan_time": 0.1, "odometry": {"x": 0.0, "y": 1, "theta": 2.0}},
    }
    folder.mkdir(parents=True, exist_ok=True)
    for number, value in enumerate((scan, {"scans": [scan, {**scan, "seq": -1}]})):
        for form, body in enumerate((json.dumps(value).encode(), msgpack.packb(value))):
            (folder / f"seed-{number}-{form}").write_bytes(bytes([form]) + body)
            packed = bytes([form | 2]) + gzip.compress(body, mtime=0)
            (folder / f"seed-{number}-{form}-gzip").write_bytes(packed)


if __name__ == "__main__":
    _RUNNER = asyncio.Runner()
    if all(argument.startswith("-") for argument in sys.argv[1:]):
        sys.argv.append(tempfile.mkdtemp(prefix="lineloom-fuzz-"))
    for argument in sys.argv[1:]:
        if not argument.startswith("-"):
            _sow(Path(argument))
    atheris.Setup(sys.argv, try_one)
    atheris.Fuzz()
