"""What can go wrong with a cache, one class a kind; each is also the builtin that a caller would catch."""

# ruff: noqa: N818 - the names say what happened; "Error" at the end of each would add nothing


class CacheError(Exception):
    """Anything that the cache refuses or finds wrong."""


class InvalidRecipe(CacheError, ValueError):
    """A recipe, label or extra holds what canonical JSON cannot."""


class InvalidKey(CacheError, ValueError):
    """A key is not the 64 hexadecimal digits of a sha256."""


class SourceNotFound(CacheError, ImportError):
    """A module whose code is to be hashed has no readable Python source."""


class EditedSource(CacheError, RuntimeError):
    """A module was edited since it was imported: what runs is not what a hash of its file would name."""


class EntryNotFound(CacheError, KeyError):
    """No entry has this key."""

    def __str__(self) -> str:
        """Return the message itself: KeyError would print its repr."""
        return Exception.__str__(self)


class DamagedEntry(CacheError, OSError):
    """An entry is not, to the byte, what was published."""


class DamagedArchive(CacheError, ValueError):
    """An archive of entries is not, to the byte, what was exported, or holds what no export writes."""


class NonDeterministicStage(CacheError, RuntimeError):
    """The same recipe gave two different results."""


class InvalidArray(CacheError, ValueError):
    """An array, or a region written to it, is not what the draft can hold."""


class IncompleteDraft(CacheError, RuntimeError):
    """A draft is to be published before every chunk of it was written."""


class CacheUnavailable(CacheError, OSError):
    """The cache's folder cannot be read or written: no space, no permission, not a folder."""
