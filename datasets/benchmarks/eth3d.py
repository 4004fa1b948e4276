"""Find the two-view scenes of ETH3D: small gray images, in and out of doors.

``eth3d:DIR`` takes a scene, a folder of scenes or the folder above::

    DIR/two_view_training/<scene>/       im0.png im1.png calib.txt
    DIR/two_view_training_gt/<scene>/    disp0GT.pfm [mask0nocc.png]

The truth may also stand in the scene's own folder. A scene is named by its path below DIR. Mask: the published one,
else the warped truth's.

Source: Schöps et al., "A Multi-View Stereo Benchmark with High-Resolution Images and Multi-Camera Videos", CVPR 2017.
"""

from collections.abc import Mapping
from pathlib import Path

from semidense.datasets.arrays import ImageArray
from semidense.datasets.benchmarks.copies.publication import Publication, Source
from semidense.datasets.benchmarks.folders import contents, existing, find_scenes, open_folder, require
from semidense.datasets.errors import LayoutError
from semidense.datasets.readers import calibrated_size, read_pair, read_pfm_truth
from semidense.datasets.scene import DisparityRange, Parameter, SceneSource, Truth

DISPARITIES = DisparityRange(0, 63)
"""A fixed choice: ``ndisp`` in this benchmark's ``calib.txt`` is the image's width and bounds nothing."""

PUBLICATIONS = (
    Publication(
        name="eth3d",
        spec="eth3d:eth3d/two_view_training",
        sources=tuple(
            Source(f"https://www.eth3d.net/data/{name}.7z", f"eth3d/{name}")
            for name in ("two_view_training", "two_view_training_gt", "two_view_test")
        ),
        licence="for research, see its page",
        cite="Schöps et al., CVPR 2017",
        home="https://www.eth3d.net/datasets",
    ),
)

_PATTERN = "im0.png im1.png calib.txt [disp0GT.pfm] [mask0nocc.png]"
_REQUIRED = ("im0.png", "im1.png", "calib.txt")
_TRUTH = (("truth", "disp0GT.pfm"), ("mask", "mask0nocc.png"))


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the scenes at or below a folder.

    Raises:
        LayoutError: If there is no scene, or one lacks files.
        DatasetError: If the folder is missing, or a ``calib.txt`` or an image's header is not valid.
    """
    root = open_folder(argument, "eth3d:DIR")
    found = find_scenes(root, lambda folder: (folder / "im0.png").is_file())
    if not found:
        raise LayoutError(f"{root}: no ETH3D scene; expected folders of {_PATTERN}; found {contents(root)}")
    return tuple(_source(folder, name) for name, folder in found)


def read_images(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> tuple[ImageArray, ImageArray]:
    """Read the left and the right view; raises `DatasetError` if one cannot be read."""
    return read_pair(files)


def read_truth(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> Truth:
    """Read the truth and its mask; raises `DatasetError` if one cannot be read."""
    return read_pfm_truth(files)


def _source(folder: Path, name: str) -> SceneSource:
    require(folder, _REQUIRED, _PATTERN)
    files = {"left": folder / "im0.png", "right": folder / "im1.png", "calib": folder / "calib.txt"}
    size, calib = calibrated_size(files)
    scene = folder.resolve()
    published = scene.parent.parent / "two_view_training_gt" / scene.name
    truth = existing(folder, _TRUTH) or existing(published, _TRUTH)
    return SceneSource(
        name=name,
        dataset="eth3d",
        split="test",
        size=size,
        disparities=DISPARITIES,
        reader=__name__,
        files={**files, **truth},
        has_truth="truth" in truth,
        calibration=calib.calibration,
        warnings=calib.warnings,
    )
