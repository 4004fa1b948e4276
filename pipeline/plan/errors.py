"""What can go wrong in a run: what the user can mend is one line, the rest keeps its cause."""

import errno

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


DISK_ERRNOS = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.EFBIG})
"""Of an ``OSError``: what a disk did, in whatever code it was noticed."""

USER_ERRORS = (UsageError, DatasetError, CacheError, StageError)
"""Errors that one line explains: the command line prints it and exits with 2."""
