"""Find Middlebury scenes in any of the layouts in which they are published.

``middlebury:DIR`` takes one scene's folder, a folder of scenes (``trainingQ``, ``2003``, ``ThirdSize``), or a root that
holds several of them::

    DIR/
      MiddEval3/trainingQ/<Scene>/    im0.png im1.png calib.txt [disp0GT.pfm disp1GT.pfm mask0nocc.png]; and testQ, H, F
      2014/<Scene>-perfect/           im0.png im1.png calib.txt disp0.pfm disp1.pfm [im1E.png im1L.png ambient/L1/...]
      2021/data/<scene>/              the same [ambient/F0/im0e0.png ...]
      2001/<Scene>/                   im2 im6 disp2 [disp6] [nonocc], .png, .ppm or .pgm; disparity x 8, Tsukuba x 16
      2001/tsukuba/                   scene1.row3.col3.ppm scene1.row3.col4.ppm truedisp.row3.col3.pgm; the same
      2003/<Scene>/                   im2 im6 disp2 [disp6] [nonocc]; disparity x 4
      2005/ThirdSize/<Scene>/         view1.png view5.png [disp1.png] [disp5.png] [Illum1/Exp0/...]; disparity x 3
      2006/HalfSize/<Scene>/          the same, disparity x 2; in FullSize x 1

``middlebury:DIR,right=E`` takes another picture of the right view, ``left=`` of the left: ``E`` (exposure) and ``L``
(lighting) of 2014, ``L1.e0`` of ``ambient/L1/im?e0.png``, ``Illum1.Exp0`` of 2005 and 2006. ``*`` takes all there are:
``left=*,right=*`` is the whole grid. Such a scene is named ``<Scene>@RIGHT`` or ``<Scene>@LEFT-RIGHT``.

A scene is named by its path below DIR: ``Teddy`` in ``trainingQ``, ``2003/Cones`` in the root, so that the Teddy of
MiddEval3 and that of 2003 keep apart. MiddEval3, 2014 and 2021 are for testing, 2001 to 2006 for training.

Source: https://vision.middlebury.edu/stereo/
"""

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from semidense.datasets.benchmarks import middlebury_pfm, middlebury_png
from semidense.datasets.benchmarks.folders import contents, find_scenes, open_folder
from semidense.datasets.benchmarks.middlebury_sets import PUBLICATIONS
from semidense.datasets.errors import LayoutError
from semidense.datasets.scene import SceneSource

__all__ = ["PUBLICATIONS", "list_scenes"]

_PATTERN = "middlebury:DIR[,left=CONDITION][,right=CONDITION]"
_OPTION = re.compile(r",(left|right)=([^,]*)$")
_PICTURES = (
    (re.compile(r"(Illum\d)/(Exp\d)/view(1|5)\.\w+"), {"1": "left", "5": "right"}),
    (re.compile(r"ambient/(\w+)/im([01])(e\d+)\.png"), {"0": "left", "1": "right"}),
    (re.compile(r"im(1)([EL])\.png"), {"1": "right"}),
)
_GLOBS = ("Illum?/Exp?/view[15].*", "ambient/*/im[01]e*.png", "im1[EL].png")


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the scenes at or below a folder.

    Raises:
        LayoutError: If there is no scene, or one lacks files or a condition; names what was expected and found.
        DatasetError: If the folder is missing, or a ``calib.txt`` or an image's header is not valid.
    """
    argument, wanted = _options(argument)
    root = open_folder(argument, _PATTERN)
    found = find_scenes(root, _is_scene)
    if not found:
        patterns = "; ".join([*middlebury_pfm.PATTERNS, *middlebury_png.PATTERNS])
        raise LayoutError(f"{root}: no Middlebury scene; expected folders of {patterns}; found {contents(root)}")
    return tuple(source for name, folder in found for source in _sources(folder, name, wanted))


def _options(argument: str) -> tuple[str, dict[str, str]]:
    """Return the folder, and the condition that is wanted of each view that has one."""
    wanted: dict[str, str] = {}
    while option := _OPTION.search(argument):
        wanted[option[1]] = option[2]
        argument = argument[: option.start()]
    return argument, wanted


def _is_scene(folder: Path) -> bool:
    return middlebury_pfm.is_scene(folder) or middlebury_png.is_scene(folder)


def _sources(folder: Path, name: str, wanted: Mapping[str, str]) -> Iterator[SceneSource]:
    module = middlebury_pfm if middlebury_pfm.is_scene(folder) else middlebury_png
    pictures = _pictures(folder) if wanted else {}
    choices = [_chosen(folder, role, wanted.get(role), pictures) for role in ("left", "right")]
    for left, right in itertools.product(*choices):
        views = {role: pictures[role, each] for role, each in (("left", left), ("right", right)) if each}
        condition = "-".join(each or "default" for each in ([left] if left else []) + ([right] if views else []))
        yield module.source(folder, f"{name}@{condition}" if condition else name, views)


def _chosen(
    folder: Path, role: str, wanted: str | None, pictures: Mapping[tuple[str, str], Path]
) -> Sequence[str | None]:
    there = sorted(condition for view, condition in pictures if view == role)
    if wanted is None:
        return [None]
    if wanted == "*" and there:
        return there
    if wanted not in there:
        raise LayoutError(f"{folder}: no {role} view under {wanted!r}; there are {', '.join(there) or 'none'}")
    return [wanted]


def _pictures(folder: Path) -> dict[tuple[str, str], Path]:
    """Return the picture of each view and condition, such as ``("left", "Illum1.Exp0")``."""
    found = {}
    for pattern, (parts, views) in zip(_GLOBS, _PICTURES, strict=True):
        for path in folder.glob(pattern):
            if match := parts.fullmatch(path.relative_to(folder).as_posix()):
                view = next(each for each in match.groups() if each in views)
                found[views[view], ".".join(each for each in match.groups() if each != view)] = path
    return found
