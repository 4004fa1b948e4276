"""Let a forked child read opened entries: give it Dask threads of its own.

A fork copies Dask's pool but not the pool's threads. A read in the child would wait for them for ever. zarr resets its
own threads; Dask does not.
"""

import os
import sys
from threading import Lock
from typing import Any


def renew_dask_threads() -> None:
    """Forget the pools of Dask's threaded scheduler, and its lock, which a thread may have held during the fork."""
    threaded: Any = sys.modules.get("dask.threaded")
    if threaded is not None:
        threaded.pools_lock = Lock()
        threaded.default_pool = None
        threaded.pools.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=renew_dask_threads)
