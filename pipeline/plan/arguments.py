"""Bring what a caller gives in several ways into one form, or refuse it in one line."""

import math
import os
from collections.abc import Iterable
from numbers import Integral, Real
from typing import cast

import numpy as np

from semidense.pipeline.plan.errors import UsageError, shortened

Texts = Iterable[str] | str | None
"""What ``texts`` takes: one text, several, or none."""


def texts(what: str, given: object) -> tuple[str, ...]:
    """Return the texts of an argument that takes one, several or, as None, none.

    Raises:
        UsageError: if it is something else.

    >>> texts("scenes", "Teddy"), texts("scenes", ["Teddy", "Cones"]), texts("scenes", None)
    (('Teddy',), ('Teddy', 'Cones'), ())
    """
    if given is None or isinstance(given, str):
        return () if given is None else (given,)
    try:
        found: tuple[object, ...] = tuple(given)  # type: ignore[arg-type]
    except TypeError:
        found = (None,)
    if not all(isinstance(each, str) for each in found):
        raise UsageError(f"{what} = {shortened(given)}: give a text, or a list of texts")
    return cast(tuple[str, ...], found)


def require_number(what: str, given: object) -> float:
    """Return a number as it was given.

    Raises:
        UsageError: if it is none: a text, NaN, or True and False.
    """
    if isinstance(given, Real) and not isinstance(given, bool) and not math.isnan(given):
        return cast(float, given)
    raise UsageError(f"{what} = {shortened(given)}: give a number")


def require_flag(what: str, given: object) -> None:
    """Refuse what is neither True nor False: UsageError."""
    if not isinstance(given, bool | np.bool_):
        raise UsageError(f"{what} = {shortened(given)}: give True or False")


def require_path(what: str, given: object, wanted: str) -> None:
    """Refuse what is neither a path nor None: UsageError, which names what is ``wanted``."""
    if given is not None and not isinstance(given, str | os.PathLike):
        raise UsageError(f"{what} = {shortened(given)}: give {wanted}")


def require_workers(given: object) -> None:
    """Refuse what is no number of threads, nor None for one a core: UsageError."""
    if given is not None and (not isinstance(given, Integral) or isinstance(given, bool) or given < 1):
        raise UsageError(f"workers = {shortened(given)}: give a whole number from 1, or None for one a core")
