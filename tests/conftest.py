"""Makes `tests/support` importable from every folder of tests, and loads the plugins."""

from __future__ import annotations

import sys
from pathlib import Path

pytest_plugins = ["usdmlt.testing.plugin", "pytester"]

sys.path.insert(0, str(Path(__file__).parent))
