"""One process of several: compiles what comes on stdin, and says when it is done."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import sys
import threading
import traceback

from lineloom_core.warm_up.specialisations import Specialisation

_NICENESS = 5


def main() -> None:
    """Serve until the pipe closes, and end at once then: whoever asked may be gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C goes to the whole terminal group
    with contextlib.suppress(OSError, AttributeError):
        os.nice(_NICENESS - os.nice(0))  # answers go before compiling
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_compile, args=(lines,), daemon=True).start()
    for line in sys.stdin:
        lines.put(line)
    os._exit(0)


def _compile(lines: queue.SimpleQueue[str]) -> None:
    try:
        while True:
            kernel, _, arguments = lines.get().strip().partition("|")
            Specialisation(kernel, arguments).compile()
            print(kernel, flush=True)
    except BaseException:
        traceback.print_exc()
        os._exit(1)


if __name__ == "__main__":
    main()
