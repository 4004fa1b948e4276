"""The store of results: never wrong, never half-written. It knows nothing of what the results mean.

>>> import tempfile, numpy as np
>>> from pathlib import Path
>>> folder = tempfile.TemporaryDirectory()
>>> store = Store(Path(folder.name))
>>> recipe = Recipe("square", code={"squares": "1f"}, params={"n": 3}, inputs={}, environment={})
>>> with store.begin(recipe, {"product": "square"}) as draft:
...     draft.create_array("square", (3,), "int64", chunks=(3,), dims=("n",), attrs={"units": "1"})
...     draft.write("square", (slice(0, 3),), np.array([0, 1, 4]))
>>> store.open(recipe.key)["square"].values
array([0, 1, 4])
"""

from semidense.cache.entries.backend import Checkpoint, Claim, Draft, Lease
from semidense.cache.entries.encoded import Encoded, Values, encode
from semidense.cache.entries.entry import Entry
from semidense.cache.errors import (
    CacheError,
    CacheUnavailable,
    DamagedArchive,
    DamagedEntry,
    EditedSource,
    EntryNotFound,
    IncompleteDraft,
    InvalidArray,
    InvalidKey,
    InvalidRecipe,
    NonDeterministicStage,
    SourceNotFound,
)
from semidense.cache.keys.code import code_hash_of, code_parts, module_hash, require_imported_as_hashed
from semidense.cache.keys.recipe import ABSENT, Change, Recipe, differences
from semidense.cache.store import Store

__all__ = [
    "ABSENT",
    "CacheError",
    "CacheUnavailable",
    "Change",
    "Checkpoint",
    "Claim",
    "DamagedArchive",
    "DamagedEntry",
    "Draft",
    "EditedSource",
    "Encoded",
    "Entry",
    "EntryNotFound",
    "IncompleteDraft",
    "InvalidArray",
    "InvalidKey",
    "InvalidRecipe",
    "Lease",
    "NonDeterministicStage",
    "Recipe",
    "SourceNotFound",
    "Store",
    "Values",
    "code_hash_of",
    "code_parts",
    "differences",
    "encode",
    "module_hash",
    "require_imported_as_hashed",
]
