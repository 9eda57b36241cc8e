"""Memory that large blocks leave is given back, also between small ones that stay."""

from __future__ import annotations

import ctypes
import subprocess
import sys

import pytest

CHURN = """
import sys
from lineloom_service.allocator import give_back, trim

def resident_mb():
    status = open("/proc/self/status").read()
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024

if sys.argv[1] == "tamed":
    assert give_back()
elif sys.argv[1] != "as it is":
    many = [bytearray(3_000) for _ in range(30_000)]
    stay = many[::50]
    del many
    if sys.argv[1] == "trimmed":
        trim()
    print(resident_mb())
    sys.exit()
del_me = bytearray(30_000_000)
del del_me  # from now on glibc by itself takes such blocks from its heap
before = resident_mb()
large, small = [], []
for _ in range(100):
    large.append(bytearray(b"x" * 1_000_000))
    small.append(bytearray(2_000))
del large[:-1]
print(resident_mb() - before)
"""


pytestmark = pytest.mark.skipif(
    not hasattr(ctypes.CDLL(None), "mallopt"), reason="this C library has no mallopt"
)


def left_mb(how: str) -> float:
    """Resident memory [MB] that the churn leaves behind."""
    done = subprocess.run(
        [sys.executable, "-c", CHURN, how], stdout=subprocess.PIPE, text=True, check=True
    )
    return float(done.stdout)


def test_freed_blocks_are_given_back() -> None:
    assert left_mb("tamed") < 10.0


def test_trimming_gives_back_what_is_free_between_what_stays() -> None:
    assert left_mb("trimmed") < left_mb("untrimmed") - 60.0


def test_the_churn_is_one_that_the_c_library_keeps() -> None:
    assert left_mb("as it is") > 50.0
