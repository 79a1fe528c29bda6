"""Short texts of named tuples."""

from typing import Any

import numpy as np

_NUMBERS = 12
"""Maximum length of a vector or list that is printed in full when a result is printed. For a longer vector or list,
only the shape is printed.
"""


def _shown(value: object) -> str:
    if isinstance(value, np.ndarray):
        if value.ndim > 1 or value.size > _NUMBERS:
            return f"<array {value.shape}>"
        return np.array2string(value, separator=", ", max_line_width=1000)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k!r}: {_shown(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list) and len(value) > _NUMBERS:
        return f"<list of {len(value)}>"
    return repr(value)


def short(self: Any) -> str:
    """Returns a short text with the members of a named tuple."""
    return f"{type(self).__name__}({', '.join(f'{k}={_shown(v)}' for k, v in self._asdict().items())})"
