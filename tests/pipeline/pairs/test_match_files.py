"""What the summary of a match says beside its maps."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from semidense.pipeline.pairs.match_files import _calibration_notes
from semidense.pipeline.pairs.wishes import Wishes
from semidense.pipeline.plan.shipped_weights import Weights

SHIPPED = Weights("calibration", "calibration", None, "ab")
OWN = Weights("calibration", "", Path("mine.safetensors"), "cd")


def match(mode: str, weights: Weights, wishes: Wishes) -> Any:  # noqa: ANN401
    steps = [SimpleNamespace(product="costvolume", settings={"mode": mode}, argument=None)]
    if wishes.calibrated or wishes.max_error is not None:
        steps.append(SimpleNamespace(product="calibration", settings={}, argument=weights))
    made = {step.product: SimpleNamespace(step=step) for step in steps}
    return SimpleNamespace(wishes=wishes, result=SimpleNamespace(made=made))


@pytest.mark.parametrize(
    ("mode", "weights", "wishes", "told"),
    [
        pytest.param("fast", SHIPPED, Wishes(calibrated=True), True, id="fast volumes, the table of exact ones"),
        pytest.param("fast", SHIPPED, Wishes(max_error=0.02), True, id="a wanted error rests on it too"),
        pytest.param("exact", SHIPPED, Wishes(calibrated=True), False, id="exact volumes"),
        pytest.param("fast", OWN, Wishes(calibrated=True), False, id="a calibration of the user's"),
        pytest.param("fast", SHIPPED, Wishes(R=0.8), False, id="no calibration is used"),
    ],
)
def test_a_calibration_of_other_volumes_is_told(mode: str, weights: Weights, wishes: Wishes, told: bool) -> None:
    notes = _calibration_notes(match(mode, weights, wishes))
    assert [("exact cost volumes" in note, "fast ones" in note) for note in notes] == [(True, True)] * told
