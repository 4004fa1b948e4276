"""The archive for Middlebury's evaluation, version 3.

::

    trainingQ/Teddy/disp0METHOD.pfm         dense: a disparity in every pixel
    trainingQ/Teddy/disp0METHOD_s.pfm       sparse: infinity for none
    trainingQ/Teddy/timeMETHOD.txt          seconds, a number alone

The same for ``testQ``; sizes H and F alike, one size an archive. The server takes all 15 training pairs, or all 15 of
both sets, in the dense form, the sparse form or both.

Source: https://vision.middlebury.edu/stereo/submit3/upload-format.html
"""

import re
from collections.abc import Collection, Iterator

from semidense.datasets import SceneSource
from semidense.pipeline.files.submissions.solved import Layout, Solved, check_pfm, check_seconds, pfm_bytes
from semidense.pipeline.plan.errors import UsageError
from semidense.stages.metrics.middlebury import WEIGHTS

_SET = re.compile(r"(training|test)([FHQ])")
_TRAINING = frozenset(WEIGHTS)
_TEST = frozenset(
    (
        *("Australia", "AustraliaP", "Bicycle2", "Classroom2", "Classroom2E", "Computer", "Crusade", "CrusadeP"),
        *("Djembe", "DjembeL", "Hoops", "Livingroom", "Newkuba", "Plants", "Staircase"),
    )
)
_ENDINGS = {"dense": "", "sparse": "_s"}


def place(scene: SceneSource) -> tuple[str, str]:
    """Return a scene's set with its size, such as ``trainingQ``, and its name.

    Raises:
        UsageError: if the scene is not of the evaluation.
    """
    folder = scene.files["left"].absolute().parent
    if not _SET.fullmatch(folder.parent.name):
        raise UsageError(f"{scene.name}: not of MiddEval3; keep the published folders, such as trainingQ and testQ")
    return folder.parent.name, folder.name


def _entries(solved: Solved, method: str) -> Iterator[tuple[str, bytes]]:
    folder = "/".join(place(solved.scene))
    for form, disparity in solved.maps.items():
        yield f"{folder}/disp0{method}{_ENDINGS[form]}.pfm", pfm_bytes(disparity)
    yield f"{folder}/time{method}.txt", f"{solved.seconds:.3f}\n".encode()


def _check(name: str, content: bytes, scene: SceneSource) -> None:
    if name.endswith(".pfm"):
        check_pfm(name, content, scene, dense=not name.endswith("_s.pfm"))
    else:
        check_seconds(name, content.decode())


def _lacks(scenes: Collection[SceneSource]) -> str | None:
    found: dict[str, set[str]] = {}
    for folder, name in map(place, scenes):
        found.setdefault(folder, set()).add(name)
    sizes = {folder[-1] for folder in found}
    if len(sizes) > 1:
        return f"of the sizes {' and '.join(sorted(sizes))} together"
    size = "".join(sizes)
    missing = {f"training{size}": _TRAINING - found.get(f"training{size}", set())}
    if f"test{size}" in found:
        missing[f"test{size}"] = _TEST - found[f"test{size}"]
    told = [f"{folder}: {', '.join(sorted(names))}" for folder, names in missing.items() if names]
    return f"without {'; '.join(told)}" if told else None


MIDDLEBURY = Layout("middlebury", ("dense", "sparse"), True, _entries, _check, _lacks)
"""Dense and sparse maps and times of the training pairs, or of training and test pairs."""
