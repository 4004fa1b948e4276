import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from semidense.pipeline.api import Task
from semidense.pipeline.files.suggestion import run_command

Invoke = Callable[..., Any]


@pytest.mark.parametrize(
    ("task", "words"),
    [
        pytest.param(Task(), "motorcycle", id="nothing was given"),
        pytest.param(
            Task("eth3d:a b", ["x"], ["semidense.R=0.9", "costvolume.mode=fast"], "my.toml", True, Path("c"), "robust"),
            "'eth3d:a b' --scene x --set semidense.R=0.9 --set costvolume.mode=fast --preset robust --config my.toml "
            "--cache c --train",
            id="everything was given",
        ),
    ],
)
def test_the_command_repeats_what_was_given(task: Task, words: str) -> None:
    assert run_command(task) == f"pipeline run {words}"
    assert run_command(task, "disparity") == f"pipeline run {words} --upto disparity"


SPEC = "synthetic:train=0,test=1"


@pytest.mark.parametrize(
    ("command", "upto"),
    [
        pytest.param(["inspect", "images"], " --upto images", id="inspect"),
        pytest.param(["explain", "images", "--graph", "g.svg"], " --upto images", id="explain"),
        pytest.param(["report"], "", id="report"),
    ],
)
def test_every_refusal_suggests_a_command_with_the_user_s_options(
    invoke: Invoke, tmp_path: Path, command: list[str], upto: str
) -> None:
    verb, *more = command
    product, options = more[:1], more[1:]
    given = ["--set", "semidense.R=0.8", "--preset", "robust", "--cache", str(tmp_path / "c")]
    ran = invoke(verb, *product, SPEC, *given, *options)
    assert ran.code == 2
    assert f"`pipeline run {SPEC} {shlex.join(given)}{upto}`" in ran.err
