"""Who holds a lock, in words for people. What is alive is told by held locks, never by these names."""

import os
import re
import socket
from functools import cache

_OWNER = re.compile(r"(?P<host>[A-Za-z0-9._]+)-(?P<pid>\d+)", re.ASCII)


def owner() -> str:
    """Return the name of this process: ``host-pid``."""
    return f"{_host()}-{os.getpid()}"


def describe(name: str) -> str | None:
    """Return what ``owner`` gave as words for people, ``process 123 on host``; None for any other text."""
    match = _OWNER.fullmatch(name)
    return f"process {match['pid']} on {match['host']}" if match else None


@cache
def _host() -> str:
    """Return this host's name, reduced to what a file name can hold."""
    return re.sub(r"[^A-Za-z0-9._]", "_", socket.gethostname()) or "host"
