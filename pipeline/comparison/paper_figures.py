"""The figures that the paper's text reports. They are shown beside ours, and never averaged with them."""

from typing import Any

_TEST = "Middlebury 2014 test set, Middlebury's own resolution and mask"
_TRAINING = "15 Middlebury 2014 training pairs"
_RAW = f"{_TRAINING}, half size, over 1 px, nonocc, mean"
_AUC = f"{_TRAINING}, learnt on the 13 additional pairs, mean"
_AUC_OTHERS = f"{_AUC}; on the raw maps of MC-CNN, as reported by Tosi et al. 2017"


def _rows(experiment: str, figure: str, data: str, values: dict[str, float]) -> list[dict[str, Any]]:
    return [
        {"experiment": experiment, "method": method, figure: value, "data": data, "quoted": True}
        for method, value in values.items()
    ]


QUOTED: tuple[dict[str, Any], ...] = (
    *_rows("raw", "raw_bad", _RAW, {"dual-cnn (paper)": 18.69, "MC-CNN-acrt (paper)": 22.91}),
    *_rows(
        "density",
        "rms",
        _TEST,
        {"dual-cnn (paper)": 3.86, "R-NCC": 4.61, "IDR": 8.07, "MPSV": 9.25, "INTS": 10.6, "SGM (paper)": 10.9},
    ),
    *_rows("auc", "auc", _AUC, {"dual-cnn (paper)": 0.0522}),
    *_rows("auc", "auc", _AUC_OTHERS, {"APKR (paper)": 0.0728, "O1 (paper)": 0.0680, "CCNN (paper)": 0.0637}),
)
"""One row a figure: errors in percent, rms in px, areas as fractions. Data and resolution differ from ours."""

NAMED = ("SED", "R-NCC", "r200high", "ICSG", "DF", "MotionStereo", "IDR", "TMAP")
"""Systems that the paper only plots: its text gives no figures for them."""
