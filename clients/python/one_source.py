"""Makes the synchronous client of the asynchronous one: `python clients/python/one_source.py`.

A test holds the two to each other.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).parent / "lineloom"
MODULES = {
    "async_client.py": "client.py",
    "async_following.py": "following.py",
    "async_queries.py": "queries.py",
}

_WORDS = {
    "AsyncBaseTransport": "BaseTransport",
    "AsyncClient": "Client",
    "AsyncIterator": "Iterator",
    "AsyncQueries": "Queries",
    "__aenter__": "__enter__",
    "__aexit__": "__exit__",
    "aclose": "close",
    "aiter_sse": "iter_sse",
    "aread": "read",
    "async_following": "following",
    "async_queries": "queries",
    "asyncio.sleep": "time.sleep",
    "import asyncio": "import time",
    "The asynchronous client": "The client",
    "the asynchronous client": "the client",
    "for asyncio": "for threads",
}
_WORD = re.compile("|".join(rf"\b{re.escape(word)}\b" for word in _WORDS))


def synchronous(text: str) -> str:
    """Return the module that does the same and waits in its thread."""
    plain = _WORD.sub(lambda found: _WORDS[found[0]], text)
    plain = re.sub(r"\b(async|await) ", "", plain)
    plain = re.sub(r"for (\w+) in ([\w.]+):\n +yield \1\n", r"yield from \2\n", plain)
    if plain.count("import time\n") > 1:
        plain = plain.replace("import time\n", "", 1)
    return _formatted(plain)


def _formatted(text: str) -> str:
    """As ruff writes it: shorter names let lines flow together."""
    ruff = Path(sys.executable).with_name("ruff")
    for command in (["check", "--select", "I", "--fix", "--exit-zero", "--quiet"], ["format"]):
        line = [str(ruff), *command, "--stdin-filename", str(PACKAGE / "client.py"), "-"]
        text = subprocess.run(line, input=text, capture_output=True, text=True, check=True).stdout
    return text


def main() -> None:
    """Write them."""
    for source, made in MODULES.items():
        text = (PACKAGE / source).read_text(encoding="utf-8")
        (PACKAGE / made).write_text(synchronous(text), encoding="utf-8")


if __name__ == "__main__":
    main()
