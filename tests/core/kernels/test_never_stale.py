"""What runs is what the sources say, and what they said before is not compiled again."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.core.kernels.tiny_package import FACTOR, INNER, OUTER, TinyPackage, finish


@pytest.fixture
def tiny(tmp_path: Path) -> TinyPackage:
    return TinyPackage(tmp_path)


def test_an_edited_kernel_runs_wherever_it_is_compiled_in(tiny: TinyPackage) -> None:
    first = tiny.run(3.0)
    assert (first.results, first.compiled) == ([7.0], ["outer", "inner"])
    again = tiny.run(3.0)
    assert (again.results, again.compiled, again.target) == ([7.0], [], first.target)

    before = (tiny.root / "tiny/inner.py").stat()
    tiny.write("inner", INNER.replace("FACTOR * x", "FACTOR - x"))  # as long as it was
    os.utime(tiny.root / "tiny/inner.py", ns=(before.st_atime_ns, before.st_mtime_ns))
    edited = tiny.run(3.0)
    assert (edited.results, edited.compiled) == ([0.0], ["outer", "inner"])
    assert edited.target != first.target

    tiny.write("inner", INNER)
    back = tiny.run(3.0)
    assert (back.results, back.compiled, back.target) == ([7.0], [], first.target)


def test_a_constant_of_a_file_without_kernels_counts(tiny: TinyPackage) -> None:
    tiny.run(3.0)
    tiny.write("factor", FACTOR.replace("2.0", "5.0"))
    assert tiny.run(3.0).results == [16.0]


def test_only_what_an_edit_is_compiled_into_is_compiled_again(tiny: TinyPackage) -> None:
    tiny.run(3.0)
    tiny.write("outer", OUTER.replace("+ 1", "+ 2"))
    edited = tiny.run(3.0)
    assert (edited.results, edited.compiled) == ([8.0], ["outer"])


def test_other_dates_and_another_place_compile_nothing(tiny: TinyPackage) -> None:
    tiny.run(3.0)
    for file in tiny.root.rglob("*.py"):
        os.utime(file, (1.0, 1.0))
    tiny.root = tiny.root.rename(tiny.root.with_name("elsewhere"))
    assert tiny.run(3.0).compiled == []


def test_processes_that_compile_at_once_keep_what_each_of_them_did(tiny: TinyPackage) -> None:
    processes = [tiny.start(number) for number in (3.0, 3, 2.5, 4)]
    assert [finish(p).results for p in processes] == [[7.0], [7.0], [6.0], [9.0]]
    assert tiny.run(3.0, 3).compiled == []
    assert not list(tiny.cache.rglob("*.tmp.*"))


def test_a_torn_file_is_compiled_again_and_said(tiny: TinyPackage) -> None:
    tiny.run(3.0)
    for file in tiny.kept():
        file.write_bytes(file.read_bytes()[:100])
    torn = tiny.run(3.0)
    assert (torn.results, torn.compiled) == ([7.0], ["outer", "inner"])
    assert "compiled again" in torn.said
    assert tiny.run(3.0).compiled == []


def test_where_nothing_can_be_kept_it_says_what_to_set(tiny: TinyPackage) -> None:
    tiny.cache.write_text("a file and no folder")
    ran = tiny.run(3.0)
    assert ran.results == [7.0]
    assert ran.said.count("LINELOOM_KERNEL_CACHE") == 1
