"""`python -m tests.docs.checks_page` writes `core/docs/checks.md` from the table of checks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from lineloom_core.check import Check, Checks
from lineloom_core.checks import TABLES
from lineloom_core.mapping.config import MapperConfig

from tests.docs.pages import ROOT

PAGE = ROOT / "core" / "docs" / "checks.md"

_HEAD = """# Checks

What a constraint is held to, and a spot where a scan may have been taken: every figure in `checks`,
in the order in which it is looked at. The first one that speaks against it gives the `reason`;
`limits` in the answer to `GET …/constraints/{id}` has all of them with what they were held to.
Figures without a limit are only shown, or weighed: they add their part (`log_odds` of a limit) to
the log-odds that a set is false, which `doubt` is made of
([concepts](concepts.md#why-a-merge-waits)). Thresholds are parameters of the mapper, here as they
are by default.

This page is written from `core/lineloom_core/checks.py`: `python -m tests.docs.checks_page`.
"""


def parameters_of(checks: Checks) -> Any:
    """The configuration that its thresholds are fields of."""
    return getattr(MapperConfig(), checks.section)


def page() -> str:
    """The whole page."""
    return "\n".join([_HEAD, *(line for checks in TABLES for line in _section(checks))])


def _section(checks: Checks) -> Iterator[str]:
    yield f"## {checks.title}\n"
    yield "| figure | means | must be | parameter | reason where it is not |"
    yield "| --- | --- | --- | --- | --- |"
    for row in checks.rows:
        says = row.objection.replace("{0:.1%}", "…%")
        cells = (f"`{row.name}`", row.means, _asked(checks, row), _parameter(checks, row), says)
        yield f"| {' | '.join(cells)} |"
    yield ""


def _asked(checks: Checks, row: Check) -> str:
    if not (row.at_least or row.at_most):
        seen = "weighed" if row.weighed else "shown"
        return f"{seen}, {row.unit}" if row.unit else seen
    value = float(getattr(parameters_of(checks), row.at_least or row.at_most))
    share = row.unit == "share"
    text = f"{100.0 * value:g} %" if share else f"{value:g} {row.unit}".strip()
    way = "at least" if row.at_least else "at most"
    told = [row.told] if row.told else []
    told += ["and weighed"] if row.weighed else []
    return f"{way} {text}" + (f" ({'; '.join(told)})" if told else "")


def _parameter(checks: Checks, row: Check) -> str:
    name = row.at_least or row.at_most
    return f"`{checks.section}.{name}`" if name else ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
