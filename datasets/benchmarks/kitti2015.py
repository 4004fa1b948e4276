"""Find the scenes of KITTI Stereo 2015.

``kitti2015:DIR`` takes the root or its ``training`` (or ``testing``) folder::

    DIR/training/image_2/000000_10.png              left view, colour
    DIR/training/image_3/000000_10.png              right view
    DIR/training/disp_noc_0/000000_10.png           truth of the pixels visible in both views, 16-bit PNG
    DIR/training/disp_occ_0/000000_10.png           truth of all pixels (optional)
    DIR/training/calib_cam_to_cam/000000.txt        calibration (optional)

Source: Menze & Geiger, "Object Scene Flow for Autonomous Vehicles", CVPR 2015.
"""

from semidense.datasets.benchmarks.kitti import Edition, published, scenes
from semidense.datasets.scene import DisparityRange, SceneSource

DISPARITIES = DisparityRange(0, 127)
"""A fixed choice, as the benchmark publishes no range: nearly all of the truth is below 128 px."""

PUBLICATIONS = (
    published(
        "kitti2015",
        ("data_scene_flow.zip", "data_scene_flow_calib.zip"),
        cite="Menze & Geiger, CVPR 2015",
        page="eval_scene_flow.php?benchmark=stereo",
        megabytes=1600,
    ),
)

EDITION = Edition(
    name="kitti2015",
    views=(("image_2", "image_3"),),
    truth=("disp_occ_0", "disp_noc_0"),
    calibration="calib_cam_to_cam",
    disparities=DISPARITIES,
    split="test",
)


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the scenes, in the order of their numbers; raises what `semidense.datasets.benchmarks.kitti.scenes` does."""
    return scenes(EDITION, argument)
