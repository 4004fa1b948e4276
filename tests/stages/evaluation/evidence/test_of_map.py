import numpy as np

from semidense.stages.evaluation.evidence.of_map import compressed, opened


def test_features_are_compressed_by_their_size_and_keep_their_sign() -> None:
    found = compressed(np.float32([[3, -3, 0, np.nan]]))
    np.testing.assert_allclose(found, [[np.log(4), -np.log(4), 0, 0]], rtol=1e-6)
    assert found.dtype == np.float32
    np.testing.assert_allclose(opened(found), [[3, -3, 0, 0]], rtol=1e-6)


def test_an_infinite_feature_is_a_large_one_and_nothing_given_is_changed() -> None:
    given = np.float32([np.inf, -np.inf, 2])
    assert np.isfinite(compressed(given)).all() and compressed(given)[1] == -compressed(given)[0]
    assert given.tolist() == [np.inf, -np.inf, 2]
