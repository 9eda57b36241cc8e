"""Workers that are there at once: forked from a process that has imported everything already.

The tests start hundreds of workers, and each would spend seconds on its imports. All that a worker
does is the same. That it is a program of its own is tried wherever a whole service is started.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import pytest

PROGRAM = ["-P", "-m", "lineloom_service.engine"]
IMPORTED = ("lineloom_service.engine.worker", "lineloom_core.mapping.site_mapper")


@contextlib.contextmanager
def forked_workers() -> Iterator[None]:
    """Have the engine's workers forked meanwhile, but those that load kernels."""
    found = SimpleNamespace(Popen=_start, DEVNULL=subprocess.DEVNULL)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("lineloom_service.engine.worker_process.subprocess", found)
        yield


def _start(command: Sequence[str], **options: Any) -> Any:
    assert command[1:4] == PROGRAM, "a worker is started otherwise now"
    _, warm_up, *_ = command[4:]
    if warm_up:
        return subprocess.Popen(command, **options)
    return _zygote().fork(command[4:], options["pass_fds"], options["env"])


@cache
def _zygote() -> Zygote:
    return Zygote()


class Zygote:
    """The process that forks. Ends with this one."""

    def __init__(self) -> None:
        self._control, theirs = socket.socketpair()
        with theirs:
            number = theirs.fileno()
            subprocess.Popen(
                [sys.executable, __file__, str(number)],
                stdin=subprocess.DEVNULL,
                pass_fds=[number],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            )

    def fork(
        self, arguments: Sequence[str], pass_fds: Sequence[int], env: dict[str, str]
    ) -> Forked:
        """Start a worker as `subprocess.Popen` would."""
        ours, theirs = socket.socketpair()
        with theirs:
            socket.send_fds(self._control, [b"f"], [theirs.fileno(), 1, 2, *pass_fds])
        request = {"arguments": list(arguments), "descriptors": list(pass_fds), "env": env}
        ours.sendall(json.dumps(request).encode() + b"\n")
        return Forked(ours)


class Forked:
    """What the engine asks of `subprocess.Popen`."""

    def __init__(self, told: socket.socket) -> None:
        self._told = told.makefile("r")
        told.close()
        self.pid = int(self._told.readline())
        self.returncode: int | None = None
        self._waiting = threading.Lock()

    def kill(self) -> None:
        """End it at once."""
        if self.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> int:
        """Return how it ended, when it has."""
        with self._waiting:
            if self.returncode is None:
                self.returncode = int(self._told.readline())
                self._told.close()
            return self.returncode


def _serve(control: socket.socket) -> None:
    """Fork whenever asked to, and tell how the children end."""
    for name in IMPORTED:
        import_module(name)
    woken, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    children: dict[int, socket.socket] = {}
    while True:
        ready, _, _ = select.select([control.fileno(), woken], [], [])
        if woken in ready:
            os.read(woken, 4096)
            _reap(children)
        if control.fileno() in ready:
            asked, descriptors, _, _ = socket.recv_fds(control, 1, 16)
            if not asked:
                return
            teller = socket.socket(fileno=descriptors[0])
            pid = os.fork()
            if pid == 0:
                for other in (control, *children.values()):
                    other.close()
                _be_worker(teller, descriptors[1:])
            for descriptor in descriptors[1:]:
                os.close(descriptor)
            teller.sendall(f"{pid}\n".encode())
            children[pid] = teller


def _reap(children: dict[int, socket.socket]) -> None:
    while children:
        pid, status = os.waitpid(-1, os.WNOHANG)
        if pid == 0:
            return
        with children.pop(pid) as teller, contextlib.suppress(OSError):
            teller.sendall(f"{os.waitstatus_to_exitcode(status)}\n".encode())


def _be_worker(teller: socket.socket, descriptors: Sequence[int]) -> None:
    """Do what `python -m lineloom_service.engine` does, and end as it ends."""
    worker = import_module("lineloom_service.engine.worker")
    code = 1
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        with teller, teller.makefile("r") as request:
            asked = json.loads(request.readline())
        out, err, *passed = descriptors
        os.dup2(out, 1)
        os.dup2(err, 2)
        for descriptor in (out, err):
            os.close(descriptor)
        os.environ.clear()
        os.environ.update(asked["env"])
        sys.path[:] = asked["env"]["PYTHONPATH"].split(os.pathsep)
        number = dict(zip(map(str, asked["descriptors"]), passed, strict=True))
        mapper, warm_up, publish_every_s, settle_after_s, pipe, life, current = asked["arguments"]
        worker.run_worker(
            mapper,
            warm_up or None,
            float(publish_every_s),
            float(settle_after_s),
            pipe=number[pipe],
            life=number[life],
            current=number[current],
        )
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))
