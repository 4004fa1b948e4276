"""Small sealed JSON files: the records and manifests of the cache.

A document has exactly one spelling, and carries the checksum of its own content. So any changed
byte of the file is noticed, also one that JSON itself would forgive, such as white space.
"""

import hashlib
import json
import threading
from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, Generic, NoReturn, TypeAlias, TypeVar

from semidense.cache.errors import InvalidRecipe

FORMAT_VERSION = 1
"""The version of keys, records and manifests; it enters every key."""

D = TypeVar("D")
Json: TypeAlias = dict[str, Any] | list[Any] | str | int | float | bool | None
_AS_THEY_ARE = frozenset((str, int, bool, type(None)))
_TEXT = {str}


def plain(value: object) -> Json:
    """Return ``value`` as plain JSON types: dicts with text keys, lists, scalars; tuples become lists.

    Raises:
        InvalidRecipe: for NaN, infinities and every other type, NumPy scalars included: their
            spelling is not promised to stay.
    """
    if type(value) in _AS_THEY_ARE:
        return value  # type: ignore[return-value]
    if type(value) is float:
        return _finite(value)
    if isinstance(value, (dict, Mapping)):  # a dict is known at once, a Mapping is asked for
        return plain_mapping("value", value)
    if isinstance(value, (list, tuple)):
        return [item if type(item) in _AS_THEY_ARE else plain(item) for item in value]
    raise InvalidRecipe(f"{value!r} is a {type(value).__name__}: convert it to a plain str, int, float, bool or list")


def _finite(value: float) -> float:
    """Return a number if JSON can spell it."""
    if not isfinite(value):
        raise InvalidRecipe(f"{value!r} has no JSON spelling: use None or text in its place")
    return value


def plain_mapping(name: str, value: object) -> dict[str, Any]:
    """Return a mapping as a dict of plain JSON types, in the order in which files have its keys.

    Raises:
        InvalidRecipe: naming it, if it is not a mapping or holds what JSON cannot.
    """
    if not isinstance(value, (dict, Mapping)):
        raise InvalidRecipe(f"{name} must be a mapping, not {value!r}")
    if not set(map(type, value)) <= _TEXT:
        _refuse_keys(value)
    # Most items stay as they are: a call for each would take most of the time in which a plan reads a cache.
    return {key: item if type(item := value[key]) in _AS_THEY_ARE else plain(item) for key in sorted(value)}


def _refuse_keys(value: Mapping[Any, Any]) -> NoReturn:
    """Refuse a mapping with a key that is not text; JSON would silently turn 1 and "1" into the same one."""
    key = next(key for key in value if type(key) is not str)
    raise InvalidRecipe(f"the mapping key {key!r} is a {type(key).__name__}: only text can be one")


def canonical(value: object) -> str:
    """Return the one canonical JSON text of ``value``: sorted keys, no spaces, ASCII only.

    >>> canonical({"b": (1, 2.0), "a": None})
    '{"a":null,"b":[1,2.0]}'

    Raises:
        InvalidRecipe: as ``plain`` does.
    """
    return _spelled(plain(value))


_spelled: Callable[[Json], str] = json.JSONEncoder(
    sort_keys=True, allow_nan=False, check_circular=False, separators=(",", ":")
).encode
"""As ``canonical``, of what is plain already."""


def digest(value: object) -> str:
    """Return the sha256 of the canonical JSON of ``value``, in hexadecimal."""
    return digest_of_plain(plain(value))


def digest_of_plain(value: Json) -> str:
    """Return what ``digest`` does, of a value that ``plain`` returned before: a plan asks for thousands."""
    return hashlib.sha256(_spelled(value).encode("ascii")).hexdigest()


def parse(text: str) -> dict[str, Any]:
    """Read strict JSON of one object.

    Raises:
        ValueError: for anything else, for NaN and infinities, and for a repeated key.
    """
    try:
        value = _read(text)
        plain(value)  # nested too deeply for that is too deep for all that follows
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    return value


def _read(text: str) -> dict[str, Any]:
    """As ``parse``, but for what is nested deeper than Python calls functions."""
    value = _DECODER.decode(text)
    if isinstance(value, dict):
        return value
    raise ValueError("it is not a JSON object")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Build an object whose keys are all different."""
    result = dict(pairs)
    if len(result) != len(pairs):
        raise ValueError("a key is repeated")
    return result


def _refuse_constant(name: str) -> NoReturn:
    """Refuse the constants that Python's reader knows and JSON does not."""
    raise ValueError(f"{name} is not JSON")


_DECODER = json.JSONDecoder(
    object_pairs_hook=_unique, parse_constant=_refuse_constant, parse_float=lambda text: _finite(float(text))
)


class Documents(Generic[D]):
    """Documents by their bytes: a process parses the same bytes once, and never those that it wrote itself.

    Args:
        parse: makes a document from its bytes and what else it is given.
        most: how many are kept; the one that was kept first goes first.
    """

    def __init__(self, parse: Callable[..., D], most: int = 2048) -> None:
        self._parse, self._most = parse, most
        self._kept: dict[tuple[object, ...], D] = {}
        self._lock = threading.Lock()

    def read(self, data: bytes, *others: object) -> D:
        """Return the document of some bytes; raise what ``parse`` does."""
        found = self._kept.get((data, *others))
        return self.keep(self._parse(data, *others), data, *others) if found is None else found

    def keep(self, document: D, data: bytes, *others: object) -> D:
        """Keep a document with the bytes that it was written as, and return it."""
        with self._lock:
            self._kept[data, *others] = document
            if len(self._kept) > self._most:
                del self._kept[next(iter(self._kept))]
        return document

    def forget(self) -> None:
        """Forget all of them."""
        with self._lock:
            self._kept.clear()


def seal(kind: str, content: Mapping[str, Any]) -> bytes:
    """Return the file of a document: its content, kind, format and checksum, readable."""
    return seal_plain(kind, plain_mapping(kind, content))


def seal_plain(kind: str, content: dict[str, Any]) -> bytes:
    """As ``seal``, of what is plain already: a record has hundreds of values."""
    return _sealed({**content, "kind": kind, "format": FORMAT_VERSION})


def _sealed(body: dict[str, Any]) -> bytes:
    return (laid_out({**body, "checksum": digest_of_plain(body)}) + "\n").encode("ascii")


def laid_out(value: Json, line: str = "\n") -> str:
    """Return plain JSON a value a line, as ``json.dumps(value, indent=1, sort_keys=True)`` does, but much faster.

    A plan reads thousands of documents, and compares each with how it would be written. What is no list and no dict is
    spelled at once, without Python's encoder.

    Args:
        value: as ``plain`` returns it.
        line: the line break and the indent of the value's last line.
    """
    if spell := _SCALARS.get(type(value)):
        return spell(value)
    inner = f"{line} "
    if isinstance(value, dict):
        parts = [
            f"{_quoted(name)}: {spell(item) if (spell := _SCALARS.get(type(item))) else laid_out(item, inner)}"
            for name, item in sorted(value.items())
        ]
        return f"{{{inner}{f',{inner}'.join(parts)}{line}}}" if value else "{}"
    items: list[Json] = value  # type: ignore[assignment]
    texts = [spell(item) if (spell := _SCALARS.get(type(item))) else laid_out(item, inner) for item in items]
    return f"[{inner}{f',{inner}'.join(texts)}{line}]" if value else "[]"


_quoted = json.encoder.encode_basestring_ascii
_SCALARS: Mapping[type, Callable[[Any], str]] = {
    str: _quoted,
    int: repr,
    float: repr,
    bool: {False: "false", True: "true"}.__getitem__,
    type(None): lambda _: "null",
}


def unseal(kind: str, data: bytes) -> dict[str, Any]:
    """Return the content of a document that ``seal`` wrote.

    Raises:
        ValueError: saying what is wrong, if one byte differs from what was written, or if it is
            of another kind or format.
    """
    try:
        return _unsealed(kind, data)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def _unsealed(kind: str, data: bytes) -> dict[str, Any]:
    sealed = _read(data.decode("ascii"))
    if sealed.get("format") != FORMAT_VERSION:
        raise ValueError(f"has format {sealed.get('format')!r}, this program reads {FORMAT_VERSION}")
    if sealed.get("kind") != kind:
        raise ValueError(f"is a {sealed.get('kind')!r}, expected a {kind!r}")
    body = {name: value for name, value in sealed.items() if name != "checksum"}
    if _sealed(body) != data:
        raise ValueError("its checksum or spelling differs from what was written")
    return {name: value for name, value in body.items() if name not in ("kind", "format")}
