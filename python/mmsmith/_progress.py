"""How far long work is: a line on standard error, where a person sees it."""

import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: Work that is done sooner is not worth a line.
SHORT_S = 1.0


class Line:
    """One line that is written over; it is gone when the work ends."""

    def __init__(self) -> None:
        self._begun = time.monotonic()
        self._shown = False

    def __call__(self, share: float, what: str) -> None:
        """Shows the share that is done and the case under way."""
        if time.monotonic() - self._begun < SHORT_S:
            return
        width = shutil.get_terminal_size().columns - 1
        print("\r" + f"{100 * share:3.0f} %  {what}"[:width].ljust(width), end="", file=sys.stderr, flush=True)
        self._shown = True

    def clear(self) -> None:
        """Leaves an empty line."""
        if self._shown:
            print("\r" + " " * (shutil.get_terminal_size().columns - 1) + "\r", end="", file=sys.stderr, flush=True)


@contextmanager
def watcher(progress: Callable[[float, str], object] | bool | None) -> Iterator[Callable[[float, str], object] | None]:
    """The function that is told of the work; nothing is told where nobody would see it."""
    if callable(progress):
        yield progress
    elif progress or (progress is None and sys.stderr is not None and sys.stderr.isatty()):
        line = Line()
        try:
            yield line
        finally:
            line.clear()
    else:
        yield None
