"""The table of what to compile is what a drive through mapper and matcher asks for."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from lineloom_core.warm_up.specialisations import MAPPING, REST, Specialisation

GAINED = """
import json, sys
from lineloom_core.kernels.dispatcher import _Kernel
from lineloom_core.warm_up.drive import drive
from lineloom_core.warm_up.specialisations import MAPPING, REST

leave_out = sys.argv[1:]
for specialisation in (*MAPPING, *REST):
    if specialisation.kernel not in leave_out:
        specialisation.compile()
kernels = {
    f"{kernel.py_func.__module__}.{kernel.py_func.__name__}": kernel
    for name, module in list(sys.modules.items()) if name.startswith("lineloom_core.")
    for kernel in vars(module).values() if isinstance(kernel, _Kernel)
}
before = {name: set(kernel.overloads) for name, kernel in kernels.items()}
drive()
gained = {
    name: [str(signature) for signature in set(kernel.overloads) - before[name]]
    for name, kernel in kernels.items() if set(kernel.overloads) - before[name]
}
print(json.dumps(gained))
"""


def _gained(*leave_out: str) -> dict[str, list[str]]:
    """Return what a drive calls that was neither compiled nor loaded before it."""
    done = subprocess.run(
        [sys.executable, "-c", GAINED, *leave_out],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    found: dict[str, list[str]] = json.loads(done.stdout)
    return found


def test_a_drive_calls_nothing_that_is_not_in_the_table() -> None:
    assert _gained() == {}


def test_what_is_missing_in_the_table_is_seen() -> None:
    assert list(_gained("matching._registration_kernels.thin")) == [
        "lineloom_core.matching._registration_kernels.thin"
    ]


def test_nothing_is_in_the_table_twice() -> None:
    assert len({*MAPPING, *REST}) == len(MAPPING) + len(REST)


def test_arguments_that_a_kernel_does_not_take_are_refused() -> None:
    with pytest.raises(TypeError):
        Specialisation("matching._registration_kernels.thin", "f").compile()
