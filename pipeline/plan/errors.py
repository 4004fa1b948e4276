"""What can go wrong in a run: what the user can mend is one line, the rest keeps its cause."""

import difflib
import errno
from collections.abc import Iterable

from semidense.cache import CacheError
from semidense.datasets import DatasetError
from semidense.stages.stage import StageError


class PipelineError(Exception):
    """Base of the errors of this package."""


class UsageError(PipelineError, ValueError):
    """A request that cannot be carried out as it stands: an unknown name, a value out of range."""


class StageFailed(PipelineError, RuntimeError):  # noqa: N818 - it says what happened
    """A stage raised; the message names product, scene, tile and cause."""


class StageRefused(UsageError):  # noqa: N818
    """A stage refused what it was given; the message names product, scene, tile and reason."""


LONGEST_VALUE = 200
"""Characters of a value that a message repeats."""
USER_ERRORS = (UsageError, DatasetError, CacheError, StageError)
"""Errors that one line explains: the command line prints it and exits with 2."""

_MACHINE_ERRNOS = frozenset(
    {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.EFBIG, errno.EMFILE, errno.ENFILE, errno.ENOMEM}
)
_NO_MEMORY = ("allocate memory", "can't start new thread", "failed to map segment", "Cannot allocate")
"""What torch, Python's threads and the loader of libraries say for want of memory."""


def told(error: BaseException) -> str | None:
    """Return one line for an error that the user or the machine can mend; None for a fault of the program."""
    if isinstance(error, USER_ERRORS):
        return str(error)
    if _lacks_memory(error):
        return "there is not enough memory: raise its limit (ulimit -v), use fewer --workers, or smaller images"
    if isinstance(error, OSError):
        reason = error.strerror or str(error)
        more = "; raise the limit on open files (ulimit -n)" if error.errno == errno.EMFILE else ""
        return f"{error.filename or 'standard output'}: {reason}{more}"
    return None


def told_of_stage(error: Exception) -> str | None:
    """Return one line for an error of a stage that the user or the machine can mend; None for a fault of the stage."""
    machine = isinstance(error, OSError) and error.errno in _MACHINE_ERRNOS
    return told(error) if isinstance(error, USER_ERRORS) or machine or _lacks_memory(error) else None


def _lacks_memory(error: BaseException | None) -> bool:
    """Return whether an error, or what it came from, says so."""
    while error is not None:
        if isinstance(error, MemoryError) or any(words in str(error) for words in _NO_MEMORY):
            return True
        error = error.__cause__ or error.__context__
    return False


def nearest(name: str, known: Iterable[str], prefix: str = "") -> str:
    """Return a hint: the nearest known name, or all of them if none is near."""
    names = list(known)
    folded = {item.lower(): item for item in names}
    near = difflib.get_close_matches(name.lower(), folded, n=1, cutoff=0.5)
    if near:
        return f"did you mean {prefix}{folded[near[0]]}?"
    return f"there are {', '.join(prefix + item for item in names)}" if names else "it has no settings"


def shortened(value: object) -> str:
    """Return a value as a message repeats it, the start of a very long one."""
    text = repr(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}… ({len(text):,} characters)"
