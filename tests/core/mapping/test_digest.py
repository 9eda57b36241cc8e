"""A digest names all that decides what a log becomes, and nothing else."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import lineloom_core
import pytest
from lineloom_core.mapping.config import JoinConfig, MapperConfig
from lineloom_core.mapping.digest import NOT_RUN, code_digest, digest, making

PACKAGE = Path(lineloom_core.__file__).parent

IMPORTED = """
import sys, lineloom_core.mapping.site_mapper
print(*(m.__file__ for n, m in sys.modules.items() if n.startswith("lineloom_core")), sep="\\n")
"""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    ignored = shutil.ignore_patterns("__pycache__")
    return Path(shutil.copytree(PACKAGE, tmp_path / "lineloom_core", ignore=ignored))


def test_it_is_the_same_again_and_elsewhere(copy: Path) -> None:
    assert digest(MapperConfig()) == digest(MapperConfig())
    assert code_digest(copy) == code_digest(PACKAGE)


def test_other_parameters_are_another_map_of_the_same_making() -> None:
    other = digest(MapperConfig(join=JoinConfig(least_set=4)))
    thesis = digest(MapperConfig(matcher="thesis"))
    assert len({other, thesis, digest(MapperConfig())}) == 3
    assert other.split(".")[0] == making() == digest(MapperConfig()).split(".")[0]


@pytest.mark.parametrize("name", ["mapping/config.py", "graph/bayes_tree.py", "scan/scan.py"])
def test_a_changed_line_of_what_the_mapper_runs_changes_it(copy: Path, name: str) -> None:
    path = copy / name
    path.write_text(path.read_text(encoding="utf-8") + "\n_NEW = 1\n", encoding="utf-8")
    assert code_digest(copy) != code_digest(PACKAGE)


def test_a_file_that_moved_or_is_new_changes_it(copy: Path) -> None:
    (copy / "graph" / "edge.py").rename(copy / "graph" / "edge_of.py")
    moved = code_digest(copy)
    (copy / "graph" / "new.py").touch()
    assert len({moved, code_digest(copy), code_digest(PACKAGE)}) == 3


def test_what_the_mapper_does_without_does_not_change_it(copy: Path) -> None:
    for name in ("io/svg.py", "floorplan/plan.py", "warm_up/drive.py"):
        (copy / name).write_text("", encoding="utf-8")
    assert code_digest(copy) == code_digest(PACKAGE)


def test_what_is_left_out_is_not_imported_by_the_mapper() -> None:
    done = subprocess.run(
        [sys.executable, "-c", IMPORTED], stdout=subprocess.PIPE, text=True, check=True
    )
    names = [Path(line).relative_to(PACKAGE).as_posix() for line in done.stdout.split()]
    assert len(names) > 50, "the search for modules is broken"
    assert [name for name in names if name.startswith(NOT_RUN)] == []


def test_a_package_without_its_source_says_so(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="no source files"):
        code_digest(tmp_path)
