"""What the service's tests share: scans, and an engine that hosts the fake mapper."""

from __future__ import annotations

import sys
from pathlib import Path

# Worker processes inherit the path and import `fake_mapper` by its plain name.
sys.path.insert(0, str(Path(__file__).parent))
