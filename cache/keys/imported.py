"""Whether a module's file changed since the module was imported: its stamp, and when this process began."""

import os
import time
from functools import cache
from pathlib import Path

_TICK = 0.02
"""Seconds: the kernel tells a process's start to 0.01 s, and no import happens so soon after it."""
_IMPORTED = time.time()


Stamp = tuple[int, int, int]
"""Of a file: when it changed last in ns, its size in bytes, its inode."""


def stamp_of(file: Path) -> Stamp:
    """Return what differs after every change of a file."""
    status = file.stat()
    return status.st_ctime_ns, status.st_size, status.st_ino


@cache
def process_start() -> float:
    """Return when this process began, in seconds since the epoch; where that is not told, when this was imported."""
    try:
        ticks = int(Path("/proc/self/stat").read_text(errors="replace").rpartition(")")[2].split()[19])
        up = time.clock_gettime(time.CLOCK_BOOTTIME)
        return time.time() - up + ticks / os.sysconf("SC_CLK_TCK") + _TICK
    except (OSError, AttributeError):
        return _IMPORTED
