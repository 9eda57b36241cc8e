"""The service as a child process, for the demo and for tests."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from typing_extensions import Self

from lineloom.cli.failure import CommandError
from lineloom.client import Client
from lineloom.errors import ConnectionFailedError
from lineloom.retry import RetryPolicy

_STOP_S = 20.0
_POLL_S = 0.1


class ChildService:
    """`lineloom serve` in a child process; stopped cleanly at the end of the `with` block."""

    def __init__(self, data_dir: Path, port: int | None = None) -> None:
        self.data_dir = data_dir
        self.port = free_port() if port is None else port
        self.url = f"http://127.0.0.1:{self.port}"
        self.log = data_dir / "service.log"
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.stop()

    @property
    def pid(self) -> int | None:
        """The child's process id while it runs."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Start the child; its output goes to `log`."""
        self.data_dir.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "lineloom.cli", "serve", "--host", "127.0.0.1"]
        command += ["--port", str(self.port), "--data-dir", str(self.data_dir)]
        with self.log.open("ab") as log:
            # A session of its own: Ctrl-C is ours to handle, the child is told by SIGTERM.
            self._process = subprocess.Popen(
                command,
                stdout=log,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                env={k: v for k, v in os.environ.items() if k != "LINELOOM_URL"},
            )

    def wait_until_ready(
        self, timeout: float = 120.0, tell: Callable[[str], object] = lambda _: None
    ) -> None:
        """Wait until scans are mapped; a child that dies ends the command with its last words.

        tell is given what is missing whenever that changes.
        """
        deadline = time.monotonic() + timeout
        reasons = ["no answer yet"]
        with Client(self.url, retry=RetryPolicy(attempts=1), timeout=5.0) as client:
            while time.monotonic() < deadline:
                if self._process is None or self._process.poll() is not None:
                    raise CommandError(f"the service did not start: {self.last_words()}")
                try:
                    state = client.ready()
                    if state.maps:
                        return
                    if state.reasons != reasons:
                        tell("; ".join(state.reasons))
                    reasons = state.reasons
                except ConnectionFailedError as error:
                    reasons = [error.reason]
                time.sleep(_POLL_S)
        raise CommandError(
            f"the service is not ready after {timeout:g} s ({'; '.join(reasons)}); see {self.log}"
        )

    def wait(self) -> None:
        """Wait until the child ends by itself, or Ctrl-C."""
        if self._process is not None:
            self._process.wait()

    def stop(self) -> None:
        """Ask the child to stop, and see to it that it does, with all its own children."""
        process, self._process = self._process, None
        if process is None:
            return
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(_STOP_S)
                return
            except subprocess.TimeoutExpired:
                pass
        try:
            # It leads a process group of its own, so that no worker is left behind.
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            return
        finally:
            process.wait()

    def last_words(self) -> str:
        """Return the end of the child's log, on one line."""
        try:
            lines = self.log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        except OSError:
            lines = []
        return lines[-1].strip() if lines else f"it said nothing; see {self.log}"


def free_port() -> int:
    """Return a port that nothing listens on now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
