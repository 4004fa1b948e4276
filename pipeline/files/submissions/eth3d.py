"""The archive for ETH3D's low-resolution two-view benchmark.

::

    low_res_two_view/lakeside_1l.pfm        infinity for none
    low_res_two_view/lakeside_1l.txt        runtime SECONDS

Source: https://www.eth3d.net/documentation#result-submission
"""

from collections.abc import Collection, Iterator

from semidense.datasets import SceneSource
from semidense.pipeline.files.submissions.solved import Layout, Solved, check_pfm, check_seconds, pfm_bytes

_TEST_SCENES = 20


def _entries(solved: Solved, _: str) -> Iterator[tuple[str, bytes]]:
    (disparity,) = solved.maps.values()
    stem = f"low_res_two_view/{solved.scene.name.rpartition('/')[2]}"
    yield f"{stem}.pfm", pfm_bytes(disparity)
    yield f"{stem}.txt", f"runtime {solved.seconds:.3f}\n".encode()


def _check(name: str, content: bytes, scene: SceneSource) -> None:
    if name.endswith(".pfm"):
        check_pfm(name, content, scene, dense=False)
    else:
        check_seconds(name, content.decode().removeprefix("runtime "))


def _lacks(scenes: Collection[SceneSource]) -> str | None:
    test = [scene for scene in scenes if not scene.has_truth]
    return f"with {len(test)} of the {_TEST_SCENES} scenes of two_view_test" if len(test) < _TEST_SCENES else None


ETH3D = Layout("eth3d", ("sparse", "dense"), False, _entries, _check, _lacks)
"""One map and a time of each test scene."""
