"""World of the examples in MuJoCo, for tests and benches."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[3] / "python" / "examples"))
from mujoco_world import Array, World, bare

__all__ = ["Array", "World", "bare"]
