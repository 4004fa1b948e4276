"""Find Middlebury scenes in any of the layouts in which they are published.

``middlebury:DIR`` takes one scene's folder, a folder of scenes (``trainingQ``, ``2003``, ``ThirdSize``), or a root that
holds several of them::

    DIR/
      MiddEval3/trainingQ/<Scene>/    im0.png im1.png calib.txt [disp0GT.pfm] [mask0nocc.png]; also testQ, sizes H, F
      2014/<Scene>/                   im0.png im1.png calib.txt disp0.pfm disp1.pfm
      2001/<Scene>/                   im2 im6 disp2 [disp6] [nonocc], .png, .ppm or .pgm; disparity x 8, Tsukuba x 16
      2003/<Scene>/                   the same, disparity x 4
      2005/ThirdSize/<Scene>/         view1.png view5.png [disp1.png] [disp5.png]; disparity x 3
      2006/HalfSize/<Scene>/          the same, disparity x 2; in FullSize x 1

A scene is named by its path below DIR: ``Teddy`` in ``trainingQ``, ``2003/Cones`` in the root, so that the Teddy of
MiddEval3 and that of 2003 keep apart. MiddEval3 and 2014 are for testing, 2001 to 2006 for training.

Source: https://vision.middlebury.edu/stereo/
"""

from pathlib import Path

from semidense.datasets.benchmarks import middlebury_pfm, middlebury_png
from semidense.datasets.benchmarks.folders import contents, find_scenes, open_folder
from semidense.datasets.errors import LayoutError
from semidense.datasets.scene import SceneSource


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the scenes at or below a folder.

    Raises:
        LayoutError: If there is no scene, or one lacks files; names the patterns expected and what was found.
        DatasetError: If the folder is missing, or a ``calib.txt`` or an image's header is not valid.
    """
    root = open_folder(argument, "middlebury:DIR")
    found = find_scenes(root, _is_scene)
    if not found:
        patterns = "; ".join([*middlebury_pfm.PATTERNS, *middlebury_png.PATTERNS])
        raise LayoutError(f"{root}: no Middlebury scene; expected folders of {patterns}; found {contents(root)}")
    return tuple(_source(folder, name) for name, folder in found)


def _is_scene(folder: Path) -> bool:
    return middlebury_pfm.is_scene(folder) or middlebury_png.is_scene(folder)


def _source(folder: Path, name: str) -> SceneSource:
    if middlebury_pfm.is_scene(folder):
        return middlebury_pfm.source(folder, name)
    return middlebury_png.source(folder, name)
