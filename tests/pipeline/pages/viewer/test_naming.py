from types import SimpleNamespace
from typing import Any

from semidense.pipeline.pages.viewer.naming import names
from semidense.stages.catalog import STAGES


def entry(stage: str, key: str = "abcdef0123", **changed: object) -> Any:  # noqa: ANN401
    """Return a record of a stage with its default settings, but for those that are changed."""
    fields = STAGES[stage].params.model_fields
    params = {name: field.default for name, field in fields.items()} | {"tiles": "32 rows"} | changed
    return SimpleNamespace(key=key, created="2026-11-28T18:49:07", recipe=SimpleNamespace(params=params))


PAPER = {
    "confidence": entry("confidence"),
    "disparity": entry("disparity"),
    "costvolume": entry("costvolume", mode="exact"),
}
ROBUST = {
    "confidence": entry("evidence_confidence"),
    "disparity": entry("aggregated", passes=2),
    "costvolume": entry("costvolume", mode="fast"),
}


def shown(*chains: dict[str, Any]) -> list[str]:
    return [name.split(" - ")[0] for name in names(chains)]


def test_preset_and_mode_come_first_and_the_time_last() -> None:
    assert names([ROBUST]) == ["robust, fast - 2026-11-28 18:49 (abcdef)"]
    assert shown(PAPER, ROBUST) == ["paper, exact", "robust, fast"], "defaults of exchanged stages are not told"


def test_a_setting_that_differs_is_told() -> None:
    wider = ROBUST | {"disparity": entry("aggregated", passes=2, paths=16)}
    assert shown(ROBUST, wider) == ["robust, fast", "robust, fast, aggregated.paths=16"]
    assert shown(wider, wider) == ["robust, fast", "robust, fast"], "what all share sets none apart"
    once = ROBUST | {"disparity": entry("aggregated", passes=1)}
    assert shown(ROBUST, once) == ["robust, fast", "robust, fast, aggregated.passes=1"], "a default is told, too"


def test_a_precision_that_nobody_set_is_told_only_where_two_differ() -> None:
    made, other = (
        ROBUST | {"confidence": entry("evidence_confidence", precision=precision)}
        for precision in ("float32", "bfloat16")
    )
    assert shown(PAPER, made) == ["paper, exact", "robust, fast"]
    assert shown(made, other) == [
        f"robust, fast, evidence_confidence.precision={precision}" for precision in ("float32", "bfloat16")
    ]


def test_the_hash_of_weights_is_told_only_where_nothing_else_differs() -> None:
    one, other = ({"evaluation_net": entry("evaluation_net", shipped=digest * 16)} for digest in ("abcd", "ef01"))
    of_robust = {"evaluation_net": entry("evaluation_net", shipped="ef01" * 16, steps=800)}
    assert shown(PAPER | one, ROBUST | of_robust) == ["paper, exact", "robust, fast"]
    assert shown(PAPER | one, PAPER | other) == [
        f"paper, exact, evaluation_net.shipped={digest * 3}" for digest in ("abcd", "ef01")
    ]


def test_the_default_mode_is_told_though_a_record_does_not_have_it() -> None:
    volume = entry("costvolume")
    del volume.recipe.params["mode"]
    assert shown(PAPER | {"costvolume": volume}) == ["paper, exact"]


def test_a_mixture_is_no_preset() -> None:
    assert shown(PAPER | {"disparity": entry("aggregated")}) == ["exact"]


def test_a_map_without_a_confidence_says_so() -> None:
    assert shown({"disparity": entry("disparity")}) == ["paper, no confidence"]
