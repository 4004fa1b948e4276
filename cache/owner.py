"""Name the process that holds a lock. Whether it is alive is decided by the lock itself, never by this name."""

import os
import re
import socket
from functools import cache

_OWNER = re.compile(r"(?P<host>[A-Za-z0-9._]+)-(?P<pid>\d+)", re.ASCII)


def owner() -> str:
    """Return the name of this process: ``host-pid``."""
    return f"{_host()}-{os.getpid()}"


def describe(name: str) -> str | None:
    """Return the text of ``owner`` in readable form, such as ``process 123 on host``; None for any other text."""
    match = _OWNER.fullmatch(name)
    return f"process {match['pid']} on {match['host']}" if match else None


@cache
def _host() -> str:
    """Return this host's name, reduced to what a file name can hold."""
    return re.sub(r"[^A-Za-z0-9._]", "_", socket.gethostname()) or "host"
