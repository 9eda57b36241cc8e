"""`python -m lineloom_core.warm_up`: compile all kernels now, for an image or a wheel."""

from __future__ import annotations

import sys

from lineloom_core.kernels import folders
from lineloom_core.kernels.target import target_name
from lineloom_core.warm_up.compiling import Compiler, is_compiled


def main() -> None:
    """Compile what is missing, with a line for each that is done; exits with 1 where it fails."""
    if not is_compiled():
        Compiler(lambda progress: print(f"compiling kernels: {progress}", flush=True)).run()
    if not is_compiled():
        sys.exit(f"nothing could be kept in {folders.writable()}: set {folders.SETTING}")
    print(f"compiled for {target_name()}")


if __name__ == "__main__":
    main()
