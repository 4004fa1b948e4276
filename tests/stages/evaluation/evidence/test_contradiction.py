import numpy as np

from semidense.stages.evaluation.evidence.contradiction import KINDS, NAMES, contradict, donors_of
from semidense.stages.evaluation.evidence.declaration import REACH


def pixels(count: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of which one in ten is wrong, and has bad evidence of every kind."""
    rng = np.random.default_rng(0)
    right = rng.random(count) < 0.9
    features = rng.normal(size=(count, len(NAMES))).astype(np.float32)
    for kind in KINDS:
        features[~right, NAMES.index(kind.worst)] += 9 * kind.sign
    return features, right


def crop() -> dict[str, np.ndarray]:
    right = np.ones((20, 24), np.int8)
    right[3] = -1
    return {"features": np.zeros((len(NAMES), 20 + 2 * REACH, 24), np.float32), "right": right}


def test_donors_are_pixels_whose_evidence_is_worse_than_that_of_right_ones() -> None:
    features, right = pixels()
    found = donors_of(features, right)
    assert len(found) == len(KINDS)
    for kind, donors in zip(KINDS, found, strict=True):
        assert [NAMES[column] for column in donors.columns] == [kind.worst, *kind.others]
        assert 0.85 < np.mean(~donors.right) < 0.97  # one in a hundred of the right ones
        assert (kind.sign * donors.features[~donors.right, 0] > 3).all()


def test_a_kind_that_is_never_bad_has_no_donors() -> None:
    features, right = pixels()
    features[:, NAMES.index(KINDS[0].worst)] = 0
    assert len(donors_of(features, right)) == len(KINDS) - 1
    assert donors_of(features, np.zeros_like(right)) == []


def test_a_region_has_the_evidence_of_donors_and_is_right_only_if_they_are() -> None:
    donors = donors_of(*pixels())[1:2]
    seen = set()
    for seed in range(40):
        given = crop()
        made = contradict(given, donors, 1, np.random.default_rng(seed))
        painted = made["features"][donors[0].columns].any(axis=0)
        rows, columns = np.nonzero(painted)
        assert painted.sum() == (np.ptp(rows) + 1) * (np.ptp(columns) + 1), "a rectangle"
        assert not np.delete(made["features"], donors[0].columns, axis=0).any()
        values = {tuple(made["features"][donors[0].columns, y, x].tolist()) for y, x in zip(rows, columns, strict=True)}
        assert values <= {tuple(each) for each in donors[0].features.tolist()}
        seen.add(len(values) == 1)
        bad = {tuple(each) for each in donors[0].features[~donors[0].right].tolist()}
        expected = given["right"].copy()
        for y, x in zip(rows - REACH, columns, strict=True):
            if (
                0 <= y < 20
                and expected[y, x] == 1
                and tuple(made["features"][donors[0].columns, y + REACH, x].tolist()) in bad
            ):
                expected[y, x] = 0
        assert np.array_equal(made["right"], expected)
        assert not given["features"].any(), "the crop itself is kept"
    assert seen == {True, False}


def test_without_a_share_nothing_is_painted() -> None:
    made = contradict(crop(), donors_of(*pixels()), 0, np.random.default_rng(0))
    assert not made["features"].any() and np.array_equal(made["right"], crop()["right"])
