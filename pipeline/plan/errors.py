"""What can go wrong in a run: what the user can mend is one line, the rest keeps its cause."""

import difflib
import errno
import os
from collections.abc import Iterable, Iterator

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
_NO_FILES = (os.strerror(errno.EMFILE),)
"""What the system says where a process has opened as many files as it may."""


def told(error: BaseException) -> str | None:
    """Return one line for an error that the user or the machine can mend; None for a fault of the program."""
    if isinstance(error, USER_ERRORS):
        return str(error)
    for lacks, line in _LACKING.items():
        if lacks(error):
            return line
    if isinstance(error, OSError):
        return f"{error.filename or 'standard output'}: {error.strerror or error}"
    return None


def told_of_stage(error: Exception) -> str | None:
    """Return one line for an error of a stage that the user or the machine can mend; None for a fault of the stage."""
    machine = isinstance(error, OSError) and error.errno in _MACHINE_ERRNOS
    lacking = any(lacks(error) for lacks in _LACKING)
    return told(error) if isinstance(error, USER_ERRORS) or machine or lacking else None


def _lacks_memory(error: BaseException) -> bool:
    return any(isinstance(each, MemoryError) or _says(each, _NO_MEMORY) for each in _chain(error))


def _lacks_files(error: BaseException) -> bool:
    """Return whether an error came from the limit on open files; a library that is not found may hide it."""
    return any(_says(each, _NO_FILES) for each in _chain(error))


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and what it came from."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _says(error: BaseException, words: Iterable[str]) -> bool:
    return any(each in str(error) for each in words)


_LACKING = {
    _lacks_memory: "there is not enough memory: raise its limit (ulimit -v), use fewer --workers, or smaller images",
    _lacks_files: "too many files are open at once: raise the limit (ulimit -n), or use fewer --workers",
}
"""What the machine may lack, and the line that says so."""


def nearest(name: object, known: Iterable[str], prefix: str = "") -> str:
    """Return a hint: the nearest known name, or all of them if none is near."""
    names = list(known)
    folded = {item.lower(): item for item in names}
    near = difflib.get_close_matches(name.lower(), folded, n=1, cutoff=0.5) if isinstance(name, str) else []
    if near:
        return f"did you mean {prefix}{folded[near[0]]}?"
    return f"there are {', '.join(prefix + item for item in names)}" if names else "it has no settings"


def shortened(value: object) -> str:
    """Return a value as a message repeats it: in one line, and of a very long one the start."""
    text = " ".join(repr(value).splitlines())
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}… ({len(text):,} characters)"
