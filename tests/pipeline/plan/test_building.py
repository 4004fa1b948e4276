import pytest

from semidense.pipeline.plan.building import resolved
from semidense.pipeline.plan.config import Config
from semidense.stages.compute import precision

TRAINED = ("matching_net", "descriptor_net")
RUN = ("costvolume", "confidence", "evaluation_net")


@pytest.mark.parametrize(
    ("flag", "trained", "run"),
    [
        pytest.param("amx_bf16", "bfloat16", "bfloat16", id="AMX"),
        pytest.param("avx512_bf16", "float32", "bfloat16", id="AVX512-BF16"),
        pytest.param("avx512f", "float32", "float32", id="neither"),
    ],
)
def test_auto_is_what_the_cpu_is_fast_at(flag: str, trained: str, run: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Gradients and descriptors are transformed in float32 alone, which plain convolutions outrun with AMX only."""
    monkeypatch.setattr(precision, "cpu_flags", lambda: frozenset({flag}))
    config = Config.load()
    for sections, expected in ((TRAINED, trained), (RUN, run)):
        for section in sections:
            assert resolved(getattr(config, section), None).precision == expected, section
    fast = config.costvolume.model_copy(update={"mode": "fast"})
    assert resolved(fast, None).precision == trained
