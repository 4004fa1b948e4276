"""The archive for KITTI Stereo 2015.

::

    disp_0/000000_10.png        16-bit PNG, 256 times the disparity, 0 for none; all 200 frames of testing

The server fills what has no disparity, see `semidense.stages.metrics.kitti.fill_background`. The time is typed in at
the upload.

Source: the development kit of Menze & Geiger, CVPR 2015.
"""

import tempfile
from collections.abc import Collection, Iterator
from pathlib import Path

from semidense.datasets import SceneSource, write_png16
from semidense.pipeline.files.submissions.solved import Layout, Solved, check_map, png16_map

_FRAMES = frozenset(f"{number:06}_10" for number in range(200))


def _entries(solved: Solved, _: str) -> Iterator[tuple[str, bytes]]:
    (disparity,) = solved.maps.values()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "map.png")
        write_png16(path, disparity)
        yield f"disp_0/{solved.scene.name.rpartition('/')[2]}.png", path.read_bytes()


def _check(name: str, content: bytes, scene: SceneSource) -> None:
    check_map(name, png16_map(name, content), scene, dense=False)


def _lacks(scenes: Collection[SceneSource]) -> str | None:
    if any(scene.has_truth for scene in scenes):
        return "of frames of training; it judges those of testing"
    missing = sorted(_FRAMES - {scene.name.rpartition("/")[2] for scene in scenes})
    return f"without {len(missing)} of the 200 frames, {missing[0]} first" if missing else None


KITTI2015 = Layout("kitti2015", ("sparse", "dense"), False, _entries, _check, _lacks)
"""One map of each of the 200 test frames."""
