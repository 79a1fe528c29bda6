"""Built-in robots, so that examples and tests need no files.

`arm7()`, `quadruped()` and `humanoid()` are models; `ARM7`, `QUADRUPED` and `HUMANOID` are their URDF texts.
"""

from ._condyle import ARM7, HUMANOID, QUADRUPED, arm7, humanoid, quadruped

__all__ = ["ARM7", "HUMANOID", "QUADRUPED", "arm7", "humanoid", "quadruped"]
