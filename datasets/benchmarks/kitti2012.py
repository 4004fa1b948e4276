"""Find the scenes of KITTI Stereo 2012: the gray cameras, or the colour ones where only those are there.

``kitti2012:DIR`` takes the root or its ``training`` (or ``testing``) folder::

    DIR/training/image_0/000000_10.png              left view, gray; or colored_0
    DIR/training/image_1/000000_10.png              right view, gray; or colored_1
    DIR/training/disp_noc/000000_10.png             truth of the pixels visible in both views, 16-bit PNG
    DIR/training/disp_occ/000000_10.png             truth of all pixels (optional)
    DIR/training/calib/000000.txt                   calibration (optional)

Disparities to search: 0 to the truth's largest, rounded up; without a truth 0 to 255, the most that the format holds.
Scenes with a truth are for training.

Source: Geiger, Lenz & Urtasun, "Are we ready for Autonomous Driving? The KITTI Vision Benchmark Suite", CVPR 2012.
"""

from semidense.datasets.benchmarks.kitti import Edition, published, scenes
from semidense.datasets.scene import SceneSource

PUBLICATIONS = (
    published(
        "kitti2012",
        ("data_stereo_flow.zip", "data_stereo_flow_calib.zip"),
        cite="Geiger, Lenz & Urtasun, CVPR 2012",
        page="eval_stereo_flow.php?benchmark=stereo",
        megabytes=1900,
    ),
)

EDITION = Edition(
    name="kitti2012",
    views=(("image_0", "image_1"), ("colored_0", "colored_1")),
    truth=("disp_occ", "disp_noc"),
    calibration="calib",
    disparities=None,
    split="train",
)


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the scenes, in the order of their numbers; raises what `semidense.datasets.benchmarks.kitti.scenes` does."""
    return scenes(EDITION, argument)
