"""Progress output of a solve."""

import importlib
import sys
from collections.abc import Callable
from typing import Any

from ._types import Iteration

_HEAD = "iter         cost         gap        stop        step  regularisation"


class Reporter:
    """A callback for a solver, which prints the iterations or shows them with tqdm."""

    def __init__(self, callback: Callable[[Iteration], object] | None, verbose: bool, progress: bool) -> None:
        self._callback, self._lines = callback, verbose
        self._bar: Any = None
        if progress:
            self._bar = _bar(desc="FDDP", unit=" iterations")
            self._lines = verbose or self._bar is None

    def __call__(self, now: Iteration) -> object:
        if self._lines:
            if now.iteration == 0:
                print(_HEAD)
            step = now.step if now.accepted else 0.0
            print(
                f"{now.iteration:4d} {now.cost:12.6e} {now.gap:11.4e} {now.stop:11.4e} {step:11.6f} "
                f"{now.regularisation:15.2e}"
            )
        if self._bar is not None:
            self._bar.set_postfix(cost=f"{now.cost:.6g}", stop=f"{now.stop:.2g}", refresh=False)
            self._bar.update()
        return None if self._callback is None else self._callback(now)

    def close(self) -> None:
        """Closes the progress bar."""
        sys.stdout.flush()
        if self._bar is not None:
            self._bar.close()


def _bar(**options: Any) -> Any:
    """Returns a tqdm progress bar, or None if tqdm is not installed."""
    try:
        tqdm: Any = importlib.import_module("tqdm.auto")
    except ImportError:
        return None
    return tqdm.tqdm(**options)


def counter(
    progress: bool | Callable[[int, Any], object], total: int | None, done: int
) -> Callable[[int | None], None]:
    """Returns a function that shows the progress of a sweep, as the argument `progress` requests. Call the returned
    function with the number of newly finished variations, and with None at the end. `total` is None if the number of
    variations is unknown.
    """
    bar = _bar(desc="sweep", unit=" variations", total=total, initial=done) if progress is True else None

    def more(count: int | None) -> None:
        nonlocal done
        done += count or 0
        if bar is not None:
            bar.close() if count is None else bar.update(count)
        elif count is not None and callable(progress):
            progress(done, total)
        elif count is not None and progress:
            print(f"{done} variations" if total is None else f"{done} of {total} variations", flush=True)

    return more
