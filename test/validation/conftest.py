"""Lets these tests share their runs with the benchmark `engine_physics`."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2]))
