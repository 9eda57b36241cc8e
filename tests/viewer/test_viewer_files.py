"""The viewer's files: shipped in the wheel, whole, small, and loading nothing from elsewhere."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import pytest
from hatchling.builders.wheel import WheelBuilder
from lineloom_service.routes.viewer import FOLDER

MOST_LINES = 400
SCRIPTS = sorted(FOLDER.rglob("*.js"))
STYLES = sorted(FOLDER.rglob("*.css"))
PAGE = FOLDER / "index.html"

IMPORT = re.compile(r'^(?:import|export) [^;]*?from "([^"]+)";', re.MULTILINE | re.DOTALL)
EXPORT = re.compile(r"^export (?:default )?(?:async )?(?:function\*?|class|const) ", re.MULTILINE)
ELSEWHERE = re.compile(r"""(?:https?:)?//[a-z0-9]""")


def name(path: Path) -> str:
    return path.relative_to(FOLDER).as_posix()


def without_comments(script: str) -> str:
    return re.sub(r"/\*.*?\*/|(?<!:)//[^\n]*", "", script, flags=re.DOTALL)


def test_the_wheel_holds_every_file(tmp_path: Path) -> None:
    builder = WheelBuilder(str(FOLDER.parents[1]))
    wheel = next(builder.build(directory=str(tmp_path), versions=["standard"]))
    with zipfile.ZipFile(wheel) as archive:
        held = set(archive.namelist())
    files = [path for path in FOLDER.rglob("*") if path.is_file()]
    assert len(files) > 40
    missing = {f"lineloom_service/viewer/{name(path)}" for path in files} - held
    assert missing == set()


def test_no_file_is_too_long() -> None:
    assert len(SCRIPTS) > 30
    texts = {name(path): path.read_text(encoding="utf-8") for path in [*SCRIPTS, *STYLES, PAGE]}
    too_long = {n: len(t.splitlines()) for n, t in texts.items() if t.count("\n") > MOST_LINES}
    assert too_long == {}


@pytest.mark.parametrize("path", SCRIPTS, ids=name)
def test_imports_exist_and_what_is_exported_says_what_it_is(path: Path) -> None:
    script = path.read_text(encoding="utf-8")
    targets = [(path.parent / target).resolve() for target in IMPORT.findall(script)]
    assert [target for target in targets if not target.is_file()] == []
    undocumented = [
        script[match.start() : script.index("\n", match.start())]
        for match in EXPORT.finditer(script)
        if not script[: match.start()].rstrip().endswith("*/")
    ]
    assert undocumented == []


def test_every_script_is_used() -> None:
    used = {FOLDER / "main.js"}
    for path in SCRIPTS:
        script = path.read_text(encoding="utf-8")
        named = [*IMPORT.findall(script), *re.findall(r'import\("([^"]+)"\)', script)]
        used |= {(path.parent / target).resolve() for target in named}
    assert [name(path) for path in SCRIPTS if path not in used] == []


def test_nothing_comes_from_elsewhere_and_nothing_is_inline() -> None:
    found = []
    for path in [*SCRIPTS, *STYLES, PAGE]:
        text = path.read_text(encoding="utf-8")
        text = without_comments(text) if path.suffix == ".js" else text
        text = text.replace("http://www.w3.org/2000/svg", "")  # a name, not an address
        found += [f"{name(path)}: {match}" for match in ELSEWHERE.findall(text)]
    assert found == []
    page = PAGE.read_text(encoding="utf-8")
    assert re.findall(r"\s(?:style|on\w+)=", page) == []
    assert re.findall(r"<script(?![^>]*\ssrc=)", page) == []
    assert "<style" not in page


def test_text_of_others_is_never_markup() -> None:
    """Names of robots and reasons come from outside."""
    barred = re.compile(r"innerHTML\s*=|outerHTML\s*=|insertAdjacentHTML|document\.write|\beval\(")
    found = [name(p) for p in SCRIPTS if barred.search(p.read_text(encoding="utf-8"))]
    assert found == []
