"""Keep freed memory in the process, for work that allocates and frees the same large arrays again and again.

By default glibc gives each large array back to the system when it is freed, and gets the next one
page by page. On virtual machines these page faults cost up to a third of a training step.

The settings cannot be taken back: glibc does not tell the earlier ones, and setting a threshold ends its own
adjusting of it for good. So no stage asks for them. The command line and the workers of a cluster do, whose processes
are ours; in a notebook or a program of your own it is your choice.
"""

import ctypes
import sys
from functools import cache

_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8  # glibc's malloc.h
_LARGEST_MMAP_THRESHOLD = 32 * 2**20  # glibc refuses more
_NEVER_TRIM = 2**31 - 1


@cache
def keep_freed_memory() -> bool:
    """Tell glibc to keep freed memory for reuse, in one arena for all threads, as long as this process lives.

    Returns:
        Whether this C library took the settings; elsewhere nothing changes but the speed.
    """
    if not sys.platform.startswith("linux"):
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    settings = ((_ARENA_MAX, 1), (_MMAP_THRESHOLD, _LARGEST_MMAP_THRESHOLD), (_TRIM_THRESHOLD, _NEVER_TRIM))
    return all(mallopt(option, value) == 1 for option, value in settings)
