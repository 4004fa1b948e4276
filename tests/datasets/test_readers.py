from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets.errors import ImageError
from semidense.datasets.readers import assemble_truth

MAP = np.full((2, 3), 5, np.float32)


@pytest.mark.parametrize("others", [0, 128], ids=["unknown", "occluded"])
def test_255_marks_what_both_views_see(tmp_path: Path, others: int) -> None:
    mask = np.array([[255, others, 255], [others] * 3], np.uint8)
    Image.fromarray(mask).save(tmp_path / "mask.png")
    truth = assemble_truth(MAP, None, tmp_path / "mask.png")
    assert truth.mask == "published"
    assert truth.nonocc.tolist() == (mask == 255).tolist()


@pytest.mark.parametrize("largest", [0, 1, 254])
def test_a_mask_that_marks_no_pixel_is_refused(tmp_path: Path, largest: int) -> None:
    Image.fromarray(np.array([[largest, 0, largest], [0] * 3], np.uint8)).save(tmp_path / "mask.png")
    with pytest.raises(ImageError, match=rf"mask\.png: no pixel of this mask is 255, .* values are 0 to {largest}$"):
        assemble_truth(MAP, None, tmp_path / "mask.png")
