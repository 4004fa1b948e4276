import numpy as np
import pytest

from semidense.stages.learning import scenes as kept
from semidense.stages.learning.scenes import Scenes


def numbered(asked: list[int], count: int = 3) -> Scenes:
    """Scenes of 16 bytes, full of their number."""

    def make(scene: int) -> np.ndarray:
        asked.append(scene)
        return np.full(4, scene, np.float32)

    return Scenes(make, count)


@pytest.mark.parametrize(
    ("most", "made"),
    [
        pytest.param(48, [0, 1, 2], id="all fit"),
        pytest.param(32, [0, 1, 2, 1, 0], id="the one that was asked for longest ago goes"),
        pytest.param(0, [0, 1, 0, 2, 1, 0], id="the last one always stays"),
    ],
)
def test_only_what_does_not_fit_is_made_again(monkeypatch: pytest.MonkeyPatch, most: int, made: list[int]) -> None:
    monkeypatch.setattr(kept, "MOST_BYTES", most)
    asked: list[int] = []
    scenes = numbered(asked)
    for scene in (0, 1, 0, 2, 2, 1, 0):
        assert scenes[scene].tolist() == [scene] * 4
    assert asked == made


def test_nothing_is_made_before_it_is_asked_for() -> None:
    assert len(Scenes(lambda _: pytest.fail("made"), 5)) == 5


@pytest.mark.parametrize("scene", [-1, 3])
def test_a_scene_that_does_not_exist_is_refused(scene: int) -> None:
    with pytest.raises(IndexError):
        numbered([])[scene]
