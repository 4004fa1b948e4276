"""Tell from the names of files which views belong together: the same name, or one that differs in the side only.

The word for the side (``left``, ``L``, ``im0``, ``cam0``, ``view0`` and their counterparts) counts at the start or the
end of a name, where a digit, a sign or nothing stands beside it. Inside a name it may be part of what is seen:
``turn_left_1`` and ``turn_right_1`` are two scenes. Names are compared as Unicode text, composed, so that names from
macOS and from elsewhere agree.
"""

import re
import unicodedata
from typing import Literal, TypeAlias

Side: TypeAlias = Literal["left", "right"]
_WORDS: dict[Side, tuple[str, ...]] = {
    "left": ("left", "l", "im0", "cam0", "view0"),
    "right": ("right", "r", "im1", "cam1", "view1"),
}
_BOTH = "|".join((*_WORDS["left"], *_WORDS["right"]))
_AT_START = re.compile(rf"({_BOTH})(?:(?<!\d)(?=\d)|(?=[\W_])|$)", re.IGNORECASE)
_AT_END = re.compile(rf"(?<![^\W\d_])({_BOTH})$", re.IGNORECASE)
_SIGNS = re.compile(r"[\W_]+")
_DIGITS = re.compile(r"0*(\d+)")


def composed(name: str) -> str:
    """Return a name in Unicode's composed form: macOS stores ``ö`` as two characters."""
    return unicodedata.normalize("NFC", name)


def without_side(stem: str, side: Side) -> str | None:
    """Return what a name of one side shares with that of the other side, None if it does not tell this side.

    >>> without_side("left_007", "left") == without_side("right_007", "right")
    True
    >>> without_side("turn_left_1", "left") is None
    True
    """
    name = composed(stem)
    for pattern in (_AT_START, _AT_END):
        found = pattern.match(name) if pattern is _AT_START else pattern.search(name)
        if found and (word := found[1].lower()) in _WORDS[side]:
            return f"{name[: found.start()]}<{_WORDS[side].index(word)}>{name[found.end(1) :]}"
    return None


def label(stem: str) -> str:
    """Return a short name for a pair: words joined by ``_``, without the word for the side at either end.

    >>> label("scene-007_left")
    'scene_007'
    """
    name = composed(stem)
    found = _AT_START.match(name)
    name = name[found.end(1) :] if found else _AT_END.sub("", name)
    return "_".join(word for word in _SIGNS.split(name) if word)


def look_alike(stem: str) -> str:
    """Return what is left of a name when signs, case, leading zeros and words for the side are passed over.

    Two names that agree in it may or may not belong together.
    """
    name = _DIGITS.sub(r" \1 ", unicodedata.normalize("NFKC", stem).casefold())
    words = [word for word in _SIGNS.split(name) if word]
    sides = {"left", "right", "l", "r"}
    return " ".join(word for word in words if word not in sides)
