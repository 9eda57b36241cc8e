"""One word for one thing, as `core/docs/concepts.md` has them: those given up stay away."""

from __future__ import annotations

import re

import pytest

from tests.architecture.test_house_rules import ROOT

GIVEN_UP = {
    "reinstate": "restore",
    "closure": "near loop, wide loop",
    "looping": "wide loops",
    "close_nearby|close_loops": "close_near_loop, close_wide_loops",
    "submap": "place",
    r"class Register\b": "KeyframeTable",
    r"class Advance\b": "Changes",
    r"being restored|Mapper\.restore\(snapshot": "resume, of a snapshot",
}
"""Pattern to the word that is used instead."""

ON_THE_WIRE = {
    "clients/python/lineloom/wire/__init__.py",
    "clients/python/lineloom/wire/graph.py",
    "core/docs/concepts.md",
    "service/lineloom_service/convert.py",
    "service/lineloom_service/viewer/data/rebuild.js",
    "service/lineloom_service/viewer/data/site_state.js",
    "service/lineloom_service/viewer/net/contract.js",
}
"""Where places are called as clients know them: `submaps`."""

_SUFFIXES = {".py", ".js", ".md", ".html"}


def texts() -> dict[str, str]:
    folders = ("core", "service", "clients")
    paths = [p for f in folders for p in (ROOT / f).rglob("*") if p.suffix in _SUFFIXES]
    found = {p.relative_to(ROOT).as_posix(): p for p in [*paths, *ROOT.glob("README.md")]}
    return {name: p.read_text(encoding="utf-8") for name, p in sorted(found.items())}


@pytest.mark.parametrize("pattern", GIVEN_UP)
def test_a_word_that_was_given_up_stays_away(pattern: str) -> None:
    word = re.compile(pattern, re.IGNORECASE)
    found = {name for name, text in texts().items() if word.search(text)}
    allowed = ON_THE_WIRE if pattern == "submap" else set()
    assert sorted(found - allowed) == [], f"say {GIVEN_UP[pattern]}"
    assert allowed <= found, "an exception that nobody needs any more"


def test_every_name_of_the_glossary_is_in_the_code() -> None:
    page = (ROOT / "core" / "docs" / "concepts.md").read_text(encoding="utf-8")
    table = page[page.index("## One word for one thing") :]
    names = {name for row in table.splitlines() for name in re.findall(r"`(\w+)`", row[1:])}
    code = "\n".join(text for name, text in texts().items() if name.endswith(".py"))
    assert len(names) > 15, "the search for names is broken"
    assert sorted(n for n in names if not re.search(rf"\b{n}\b", code)) == []
