import pytest

from semidense.stages.stage import StageError
from semidense.stages.transforms.rays import LINES, require_rays


@pytest.mark.parametrize("rays", [4, 8, 16])
def test_a_line_is_two_rays(rays: int) -> None:
    assert require_rays(rays) == rays == 2 * len(LINES[rays])


@pytest.mark.parametrize("rays", [0, 6, 32, -4])
def test_refuses_the_rest(rays: int) -> None:
    with pytest.raises(StageError, match=f"rays is {rays}, expected one of 4, 8, 16"):
        require_rays(rays)
