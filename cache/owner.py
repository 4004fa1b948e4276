"""Who a draft belongs to: host, process and the process's start, so that the drafts of the dead can be swept."""

import os
import re
import socket
from functools import cache
from pathlib import Path

_WHO = r"(?P<host>[A-Za-z0-9._]+)-(?P<pid>\d+)-(?P<start>\d+)"
_OWNER = re.compile(_WHO, re.ASCII)
_OWNED = re.compile(_WHO + r"-[0-9a-f]+(\.json)?", re.ASCII)


def owner() -> str:
    """Return the name of this process: ``host-pid-start``, start in clock ticks since boot (0 if unknown)."""
    return f"{_host()}-{os.getpid()}-{_start(os.getpid())}"


def describe(name: str) -> str | None:
    """Return what ``owner`` gave as words for people, ``process 123 on host``; None for any other text."""
    match = _OWNER.fullmatch(name)
    return f"process {match['pid']} on {match['host']}" if match else None


def is_foreign(name: str) -> bool:
    """Return whether the thing of this name belongs to a process of another host, of which nothing is known."""
    match = _OWNED.fullmatch(name)
    return match is None or match["host"] != _host()


def is_abandoned(name: str) -> bool:
    """Return whether the thing of this name belongs to a process of this host that is gone.

    A process id may be in use again; then its start tells the two apart.
    """
    match = _OWNED.fullmatch(name)
    if match is None or match["host"] != _host():
        return False
    pid = int(match["pid"])
    return not _is_running(pid) or _start(pid) != int(match["start"])


@cache
def _host() -> str:
    """Return this host's name, reduced to what a file name can hold."""
    return re.sub(r"[^A-Za-z0-9._]", "_", socket.gethostname()) or "host"


def _is_running(pid: int) -> bool:
    """Return whether a process of this id exists; another user's counts."""
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def _start(pid: int) -> int:
    """Return when a process started, in clock ticks since boot; 0 where the system does not tell."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return 0
    return int(status.rpartition(")")[2].split()[19])  # the name before it may hold anything, ")" too
