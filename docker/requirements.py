"""Prints what packages ask for of others, one requirement a line: `requirements.py FOLDER…`."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path


def main() -> int:
    """Read the folders' pyproject.toml; what they ask for of each other is left out."""
    projects = [
        tomllib.loads((Path(folder) / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        for folder in sys.argv[1:]
    ]
    own = {project["name"] for project in projects}
    wanted = {line for project in projects for line in project["dependencies"]}
    print("\n".join(sorted(line for line in wanted if re.split(r"[^\w.-]", line)[0] not in own)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
