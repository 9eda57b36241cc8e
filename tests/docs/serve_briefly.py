"""`python -m tests.docs.serve_briefly serve …`: until it answers; its exit code is handed on.

It listens on a port of its own, whatever the command line says.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import httpx

from tests.service.fake_server import free_port


def main() -> int:
    """Start, wait until it answers, stop it as an operator would."""
    port = free_port()
    command = [sys.executable, "-m", "lineloom.cli", *sys.argv[1:], "--port", str(port)]
    scheme = "https" if "--ssl-certfile" in command else "http"
    process = subprocess.Popen(command, start_new_session=True)
    try:
        _wait_up(process, f"{scheme}://127.0.0.1:{port}/healthz")
        process.terminate()
        return process.wait(20.0)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _wait_up(process: subprocess.Popen[bytes], address: str) -> None:
    deadline = time.monotonic() + 90.0
    with httpx.Client(trust_env=False, verify=False) as http:
        while time.monotonic() < deadline:
            if process.poll() is not None:
                sys.exit(f"the service ended with code {process.returncode} before it answered")
            try:
                if http.get(address).status_code == httpx.codes.OK:
                    return
            except httpx.TransportError:
                time.sleep(0.05)
    sys.exit(f"{address} did not answer")


if __name__ == "__main__":
    sys.exit(main())
