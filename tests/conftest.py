"""What holds for all tests: how long each file took is told, and the longest files begin first."""

from __future__ import annotations

import os
from collections import defaultdict
from pathlib import Path

import pytest

SLOWEST_FIRST = (
    "scenarios/test_real_logs_over_http.py",
    "docs/test_docs_run.py",
    "core/mapping/test_kidnapped.py",
    "core/mapping/test_last_bits.py",
    "service/test_upgrades.py",
    "core/mapping/test_thinning.py",
    "core/mapping/test_merging.py",
    "viewer/test_viewer_inspects.py",
    "scenarios/test_real_logs_mapped.py",
    "lab/evaluation/test_merge_bench.py",
    "lab/evaluation/test_pair_bench.py",
    "lab/experiments/test_reports.py",
    "clients/cli/test_demo.py",
    "core/kernels/test_never_stale.py",
    "core/health/test_sensor_doctor.py",
    "benchmarks/test_bench_rows.py",
    "service/test_remaking.py",
    "service/test_chapters.py",
    "contract/test_schemathesis.py",
)
"""Several processes share the files; what begins last should not take long."""

_TOLD = 10


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return one more than there are cores: a fifth of the time, some test waits for a clock."""
    return (os.cpu_count() or 1) + 1


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first; all others stay in their order."""
    order = {name: place for place, name in enumerate(SLOWEST_FIRST)}
    root = Path(__file__).parent
    items.sort(key=lambda item: order.get(str(item.path.relative_to(root)), len(order)))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the ten files that took longest."""
    seconds: dict[str, float] = defaultdict(float)
    for reports in terminalreporter.stats.values():
        for report in reports:
            if isinstance(report, pytest.TestReport):
                seconds[report.location[0]] += report.duration
    terminalreporter.section("the ten slowest files")
    for name, took in sorted(seconds.items(), key=lambda row: -row[1])[:_TOLD]:
        terminalreporter.write_line(f"{took:7.1f} s  {name}")
