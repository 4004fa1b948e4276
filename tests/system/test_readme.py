"""Every command, setting, target and file that the README and the other documents name is there."""

import importlib.util
import re
import shlex
from itertools import pairwise
from pathlib import Path

import pytest
import typer
import typer.main

from semidense.pipeline.cli.main import app

ROOT = Path(__file__).parents[2]
DOCUMENTS = [
    file for file in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/*.md"))) if file.is_file()
]
TEXT = "\n".join(file.read_text() for file in DOCUMENTS)
ELSEWHERE = "roughness"
"""The stage of docs/extending.md, which is in a package of its own; tests/system/test_extension.py tries its kind."""
NAMES = typer.main.get_command(app).commands
BLOCKS = re.findall(r"^```\w*\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
LINES = [line.strip() for block in BLOCKS for line in block.splitlines()]
INLINE = [line for line in re.findall(r"`(pipeline [^`]+)`", TEXT) if len(line.split()) > 2]  # two name a command
COMMANDS = [
    re.sub(r"^\S*?bin/", "", line)
    for line in LINES
    if re.match(r"(\S*bin/)?pipeline(\s|$)", line) and ELSEWHERE not in line
]
OPTIONS = sorted(
    {line for line in re.findall(r"`([a-z]+ [^`]*--[^`]+)`", " ".join(TEXT.split())) if line.split()[0] in NAMES}
)
"""Commands in running text, named without ``pipeline``, with an option."""
TARGETS = {
    *(line.split()[1] for line in LINES if line.startswith("make ")),
    *re.findall(r"`make ([\w-]+)", " ".join(TEXT.split())),
}
MODULES = sorted(set(re.findall(r"python -m ((?:benchmarks|tests|semidense)[\w.]*)", " ".join(TEXT.split()))))


def parse(line: str) -> None:
    """Parse a command without running it; raise what the command line would refuse."""
    command = typer.main.get_command(app)
    arguments = shlex.split(line, comments=True)[1:]
    context = command.make_context("pipeline", arguments, resilient_parsing=False)
    while hasattr(command, "commands"):
        name, found, rest = command.resolve_command(context, [*context._protected_args, *context.args])
        context = found.make_context(name, rest, parent=context)
        command = found


def test_the_readme_shows_commands() -> None:
    assert len(COMMANDS) >= 10


@pytest.mark.parametrize("line", [*COMMANDS, *INLINE])
def test_a_command_of_the_readme_parses(line: str) -> None:
    parse(line)


def unknown_options(line: str) -> list[str]:
    """Return the options of a command named in running text that the command does not have."""
    command, words = typer.main.get_command(app), line.split()
    while words and words[0] in getattr(command, "commands", {}):
        command = command.commands[words.pop(0)]
    known = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
    return [word for word in words if word.startswith("--") and word.split("=")[0].rstrip(",.") not in known]


@pytest.mark.parametrize("line", OPTIONS)
def test_a_command_in_running_text_has_its_options(line: str) -> None:
    assert unknown_options(line) == []


def test_an_option_that_a_command_does_not_have_is_found() -> None:
    assert len(OPTIONS) > 5
    assert unknown_options("cache gc --keep --nope") == ["--nope"]


@pytest.mark.parametrize("line", ["pipeline runn", "pipeline run --nope", "pipeline cache list", "pipeline run a b"])
def test_a_command_that_is_none_does_not_parse(line: str) -> None:
    with pytest.raises(Exception, match=r"(?i)no such|unexpected"):
        parse(line)


@pytest.mark.parametrize("line", COMMANDS)
def test_the_settings_and_thresholds_of_the_readme_are_valid(line: str) -> None:
    from semidense.pipeline.plan.config import Config, alternatives
    from semidense.pipeline.variants import parse_thresholds

    arguments = shlex.split(line, comments=True)
    given = list(pairwise(arguments))
    settings = [value for name, value in given if name == "--set"]
    for setting in settings:
        for each in alternatives(setting) if "sweep" in arguments else [setting]:
            Config.load(None, [each])
    for _, value in [pair for pair in given if pair[0] == "--R"]:
        assert parse_thresholds(value)


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_a_target_of_the_readme_is_in_the_makefile(target: str) -> None:
    assert re.search(rf"^{re.escape(target)}:", (ROOT / "Makefile").read_text(), re.MULTILINE)


@pytest.mark.parametrize("module", MODULES)
def test_a_module_that_the_documents_run_is_there(module: str) -> None:
    assert importlib.util.find_spec(module.replace("benchmarks.NAME", "benchmarks"))


def test_the_modules_that_the_documents_name_are_there() -> None:
    rooms = [ROOT, *(ROOT / package for package in ("pipeline", "stages", "datasets", "cache"))]
    ours = [name for name in re.findall(r"`([\w/]+/\w+\.py)`", TEXT) if not name.startswith("stereo_extras/")]
    assert [name for name in ours if not any((room / name).is_file() for room in rooms)] == []
    assert len(ours) > 10, "the documents name modules in another way: find them"


def test_each_reason_not_to_run_a_command_holds_for_one() -> None:
    from tests.system.commands import NOT_RUN, reason

    given = {reason(line) for line in COMMANDS}
    assert given == {None, *(why for _, why in NOT_RUN)}


def test_a_command_that_fails_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from tests.system.commands import run_all

    lines = ["pipeline presets", "pipeline view", "pipeline cache ls --cache new"]
    assert run_all(lines, tmp_path) == ["pipeline presets"]
    assert "not run  pipeline view" in capsys.readouterr().out


def test_each_picture_of_the_documents_is_made_by_a_command() -> None:
    from benchmarks import cost_volume, timeline
    from tests.system.pictures import PICTURES

    folder = ROOT / "docs" / "pictures"
    assert {file.name for file in folder.iterdir()} == {
        *PICTURES,
        *(each.PICTURE.name for each in (cost_volume, timeline)),
    }


def test_a_command_that_is_run_needs_no_file_that_is_not_there() -> None:
    """The folder holds ``left.png`` and ``right.png``; other files must come from an earlier command."""
    from tests.system.commands import reason

    ran = [line.split(" #")[0] for line in COMMANDS if reason(line) is None]
    assert [line for line in ran if re.search(r"(costs|disparity)=\S*\.\w+", line)] == []
