import pytest

from semidense.cache import errors


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [
        (errors.InvalidRecipe, ValueError),
        (errors.InvalidKey, ValueError),
        (errors.InvalidArray, ValueError),
        (errors.SourceNotFound, ImportError),
        (errors.EntryNotFound, KeyError),
        (errors.DamagedEntry, OSError),
        (errors.CacheUnavailable, OSError),
        (errors.NonDeterministicStage, RuntimeError),
        (errors.IncompleteDraft, RuntimeError),
    ],
)
def test_each_is_one_family_and_a_builtin(kind: type[errors.CacheError], builtin: type[Exception]) -> None:
    error = kind("what is wrong, 'where'")
    assert isinstance(error, errors.CacheError)
    assert isinstance(error, builtin)
    assert str(error) == "what is wrong, 'where'"
