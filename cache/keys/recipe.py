"""What a result is made from, and the key that names it.

``key = sha256(canonical JSON of [format version, stage, code, params, inputs, environment])``.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

from semidense.cache.document import FORMAT_VERSION, canonical, digest_of_plain, plain_mapping
from semidense.cache.errors import InvalidRecipe

Inputs = Mapping[str, str | Sequence[str] | Mapping[str, str]]
ABSENT = "(absent)"
"""Stands in a ``Change`` for an ingredient that one of the two recipes lacks."""


@dataclass(frozen=True)
class Recipe:
    """All that may change a result, and nothing else.

    Attributes:
        stage: the product's name.
        code: hash of every module that the result depends on, by module name.
        params: the fields of the configuration that the stage declares.
        inputs: output digest of each input; a list or a mapping of digests where one input is
            many results, such as one a scene.
        environment: what else changes bits, such as precision and library versions.
        version: of the format of keys and files.
        key: the sha256 of the recipe's canonical JSON, 64 hexadecimal digits.

    Everything is kept as plain JSON types; a tuple becomes a list.

    >>> recipe = Recipe("rank", {"stages.rank": "1f"}, {"window": 31}, {"images": "ab"}, {})
    >>> Recipe.from_dict(recipe.to_dict()) == recipe
    True

    Raises:
        InvalidRecipe: if a field is of another type than declared, or holds what JSON cannot.
    """

    stage: str
    code: Mapping[str, str]
    params: Mapping[str, Any]
    inputs: Inputs
    environment: Mapping[str, str]
    version: int = FORMAT_VERSION
    key: str = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Reduce the fields to plain JSON types, so that equality, key and file agree; work out the key."""
        for name in ("code", "params", "inputs", "environment"):
            object.__setattr__(self, name, plain_mapping(f"recipe.{name}", getattr(self, name)))
        if type(self.stage) is not str or not self.stage or type(self.version) is not int:
            raise InvalidRecipe(f"stage {self.stage!r}, version {self.version!r}: they must be a name and an int")
        require_texts("recipe.code", self.code)
        require_texts("recipe.environment", self.environment)
        for name, value in self.inputs.items():
            _require_digests(f"recipe.inputs.{name}", value)
        ingredients = [self.version, self.stage, self.code, self.params, self.inputs, self.environment]
        object.__setattr__(self, "key", digest_of_plain(ingredients))

    def to_dict(self) -> dict[str, Any]:
        """Return the recipe as plain JSON types."""
        names = ("stage", "code", "params", "inputs", "environment", "version")
        return {name: getattr(self, name) for name in names}

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any]) -> Self:
        """Build a recipe from what ``to_dict`` gave.

        Raises:
            InvalidRecipe: if fields are missing, unknown or of the wrong type.
        """
        try:
            recipe = cls(**fields)
        except TypeError as error:
            raise InvalidRecipe(f"not a recipe: {error}") from None
        if set(fields) != set(recipe.to_dict()):
            raise InvalidRecipe("not a recipe: it has no version")
        return recipe


def require_texts(name: str, value: object) -> None:
    """Refuse what is not a mapping of text to text.

    Raises:
        InvalidRecipe: naming what it is.
    """
    if not isinstance(value, Mapping) or {*map(type, value), *map(type, value.values())} - {str}:
        raise InvalidRecipe(f"{name} must map text to text, not {value!r}")


def _require_digests(name: str, value: object) -> None:
    """Refuse an input that is not a digest, a list of them or a mapping to them."""
    digests = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else [value]
    if any(type(item) is not str for item in digests):
        raise InvalidRecipe(f"{name} must be a digest, or a list or mapping of digests, not {value!r}")


@dataclass(frozen=True)
class Change:
    """One ingredient that differs between two recipes.

    Attributes:
        field: dotted name, such as ``params.rank_window`` or ``code.stages.transforms.rank``.
        old: its earlier value, ``ABSENT`` if it had none.
        new: its value now, ``ABSENT`` if it has none.
    """

    field: str
    old: Any
    new: Any

    def __str__(self) -> str:
        """Return one line for people, long hashes cut short."""
        return f"{self.field}: {short(self.old)} -> {short(self.new)}"


def is_hash(value: object) -> bool:
    """Return whether a value is a sha256 in lower-case hexadecimal: a key, a digest or the hash of a file."""
    return isinstance(value, str) and len(value) == 64 and set(value) <= set("0123456789abcdef")


def short(value: object) -> str:
    """Return a value's text; of a hash the first 12 digits, which tell it from all others of a cache.

    >>> short("ab" * 32), short(31), short("rank")
    ('abababababab', '31', 'rank')
    """
    text = value if isinstance(value, str) else canonical(value)
    return text[:12] if is_hash(text) else text


def differences(old: Recipe, new: Recipe) -> list[Change]:
    """Return the ingredients in which two recipes differ, sorted by name; none if the keys are equal.

    >>> before = Recipe("rank", {}, {"window": 31}, {}, {})
    >>> [str(change) for change in differences(before, Recipe("rank", {}, {"window": 15}, {}, {}))]
    ['params.window: 31 -> 15']
    """
    before, after = dict(_leaves("", old.to_dict())), dict(_leaves("", new.to_dict()))
    changes = (Change(name, before.get(name, ABSENT), after.get(name, ABSENT)) for name in sorted({*before, *after}))
    return [change for change in changes if canonical([change.old]) != canonical([change.new])]


def _leaves(prefix: str, value: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Walk a tree of mappings; an empty one counts as a leaf, so that it differs from an absent one."""
    for name, item in value.items():
        field = f"{prefix}{name}"
        if isinstance(item, dict) and item:
            yield from _leaves(f"{field}.", item)
        elif item != {} or prefix:
            yield field, item
