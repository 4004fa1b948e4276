import numpy as np
import pytest

from semidense.stages.learning.augmentation import relight


def view(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(3, 12, 15)).astype(np.float32)


def generator(seed: int = 7) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_strength_0_is_the_identity() -> None:
    assert np.array_equal(relight(view(), 0, generator()), view())


def test_strength_0_draws_nothing() -> None:
    rng = generator()
    relight(view(), 0, rng)
    assert rng.random() == generator().random()


@pytest.mark.parametrize("strength", [0.5, 1, 3])
def test_only_gray_changes(strength: float) -> None:
    given = view()
    made = relight(given, strength, generator())
    assert made.shape == given.shape and made.dtype == np.float32 and np.isfinite(made).all()
    assert np.array_equal(made[1:], given[1:])
    assert not np.array_equal(made[0], given[0])
    assert np.array_equal(given, view()), "what was given is left as it was"


def test_one_generator_gives_one_light() -> None:
    one, again, other = (relight(view(), 1, generator(seed)) for seed in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


def test_more_strength_changes_more() -> None:
    change = [
        np.mean([np.abs(relight(view(), strength, generator(seed)) - view()).mean() for seed in range(20)])
        for strength in (0.1, 0.5, 1.0)
    ]
    assert change[0] < change[1] < change[2]


def test_brighter_stays_brighter_up_to_slope_and_noise() -> None:
    ramp = np.linspace(-2, 2, 400, dtype=np.float32).reshape(1, 1, 400).repeat(30, 1)
    for seed in range(10):
        made = relight(ramp, 1, generator(seed))[0].mean(0)
        assert np.corrcoef(made, ramp[0, 0])[0, 1] > 0.95
        assert np.abs(made - ramp[0, 0]).max() < 2, "gain, gamma, offset and slope stay in their ranges"
