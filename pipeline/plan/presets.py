"""Named sets of settings to start from; a file's and single settings refine them."""

from collections.abc import Mapping

PRESETS: Mapping[str, tuple[str, ...]] = {
    "paper": (),
    "robust": (
        "channels.align=true",
        "costvolume.mode=fast",
        "use.disparity=aggregated",
        "use.right_disparity=right_aggregated",
        "aggregated.passes=2",
        "use.confidence=evidence_confidence",
        "training.weights=general",
        "training.cross_fit=true",
        "training.maps=24",
        "matching_samples.dense_share=0.5",
        "descriptor_net.width=96",
        "descriptor_net.steps=5000",
        "descriptor_net.summed_steps=1000",
        "evaluation_net.steps=800",
    ),
    "foreign": (
        "use.confidence=foreign_confidence",
        "use.calibrated_confidence=foreign_confidence",
    ),
}
"""The settings of each preset that differ from the defaults.

- ``paper``: the method of the paper: single costs, winner takes all, whole disparities.
- ``robust``: costs summed twice along paths before the winner is taken, with sub-pixel disparities: fewer wrong pixels
  where texture is thin. The confidence weighs what the costs say as well.
- ``foreign``: the confidence of maps that another matcher made. It is a probability as it is, and needs no calibration.
"""
DEFAULT = "paper"
"""The preset of a command that is given none."""
FOREIGN = "foreign"
"""The preset of ``score``, which works on maps that another matcher made."""
OWN_PAIRS = "robust"
"""The preset of ``match`` and ``StereoMatcher``, which work on a user's own pairs, if they are given none."""
