"""Workers and servers that are there at once: forked from a process that has imported everything.

The tests start hundreds of them, and each would spend seconds on its imports. All that it does is
the same. That each is a program of its own is tried wherever a whole service is started.
"""

from __future__ import annotations

import contextlib
import gc
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
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

PROGRAM = ["-P", "-m", "lineloom_service.engine"]
WORKER, SERVER = b"w", b"s"
IMPORTED = {
    WORKER: ("lineloom_service.engine.worker", "lineloom_core.mapping.site_mapper"),
    SERVER: ("tests.service.serve_fake", "uvicorn.lifespan.on", "uvicorn.loops.auto"),
}


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
    return _zygote().fork(WORKER, command[4:], options["pass_fds"], options["env"])


def forked_server(arguments: Sequence[str], env: dict[str, str]) -> Forked:
    """Start `serve_fake.py` as a process of its own, which forks its workers."""
    return _zygote().fork(SERVER, arguments, (), env)


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
        self, kind: bytes, arguments: Sequence[str], pass_fds: Sequence[int], env: dict[str, str]
    ) -> Forked:
        """Start a process as `subprocess.Popen` would."""
        ours, theirs = socket.socketpair()
        with theirs:
            socket.send_fds(self._control, [kind], [theirs.fileno(), 1, 2, *pass_fds])
        request = {"arguments": list(arguments), "descriptors": list(pass_fds), "env": env}
        ours.sendall(json.dumps(request).encode() + b"\n")
        return Forked(ours)


class Forked:
    """What the engine and the tests ask of `subprocess.Popen`."""

    def __init__(self, told: socket.socket) -> None:
        self._socket = told
        self._told = told.makefile("r")
        self.pid = int(self._told.readline())
        self.returncode: int | None = None
        self._waiting = threading.Lock()

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it is known to have ended."""
        if self.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def poll(self) -> int | None:
        """Return how it ended, None while it runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Return how it ended, when it has. Raises TimeoutExpired after `timeout` seconds."""
        with self._waiting:
            if self.returncode is None:
                if not select.select([self._socket], [], [], timeout)[0]:
                    raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
                self.returncode = int(self._told.readline())
                self._told.close()
                self._socket.close()
            return self.returncode


def _serve(control: socket.socket) -> None:
    """Fork whenever asked to, and tell how the children end."""
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
            for name in IMPORTED[asked]:
                import_module(name)
            teller = socket.socket(fileno=descriptors[0])
            pid = os.fork()
            if pid == 0:
                for other in (control, *children.values()):
                    other.close()
                _be(asked, teller, descriptors[1:])
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


def _be(kind: bytes, teller: socket.socket, descriptors: Sequence[int]) -> None:
    """Do what the program does, and end as it ends."""
    with _ending():
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
        if kind == WORKER:
            number = dict(zip(map(str, asked["descriptors"]), passed, strict=True))
            *first, pipe, life, current = asked["arguments"]
            _work([*first, number[pipe], number[life], number[current]])
        else:
            _serve_fake(*asked["arguments"])


@contextlib.contextmanager
def _ending() -> Iterator[None]:
    """End the process after this, however that ends."""
    code = 1
    try:
        yield
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _work(arguments: Sequence[Any]) -> None:
    """Be `python -m lineloom_service.engine`."""
    mapper, warm_up, publish_every_s, settle_after_s, pipe, life, current = arguments
    import_module("lineloom_service.engine.worker").run_worker(
        mapper,
        warm_up or None,
        float(publish_every_s),
        float(settle_after_s),
        pipe=int(pipe),
        life=int(life),
        current=int(current),
    )


def _serve_fake(directory: str, port: str) -> None:
    """Be a server, whose workers are forked from it: they are to be its children."""
    found = SimpleNamespace(Popen=_Child, DEVNULL=subprocess.DEVNULL)
    setattr(import_module("lineloom_service.engine.worker_process"), "subprocess", found)  # noqa: B010
    import_module("tests.service.serve_fake").serve(Path(directory), int(port))


class _Child:
    """A worker that the server forks: all that it shares with it is what it was passed."""

    def __init__(self, command: Sequence[str], **options: Any) -> None:
        assert command[1:4] == PROGRAM, "a worker is started otherwise now"
        self.returncode: int | None = None
        sys.stdout.flush()
        sys.stderr.flush()
        self.pid = os.fork()
        if self.pid == 0:
            with _ending():
                gc.freeze()  # what belongs to the server is never to be closed by number here
                signal.set_wakeup_fd(-1)
                signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                _close_all_but({0, 1, 2, *options["pass_fds"]})
                os.environ.update(options["env"])
                _work(command[4:])

    def kill(self) -> None:
        """End it at once."""
        if self.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> int:
        """Return how it ended, when it has."""
        if self.returncode is None:
            self.returncode = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return self.returncode


def _close_all_but(kept: set[int]) -> None:
    for descriptor in {int(one.name) for one in Path("/proc/self/fd").iterdir()} - kept:
        with contextlib.suppress(OSError):
            os.close(descriptor)


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))
