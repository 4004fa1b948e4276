"""The command line. Nothing heavy is imported before a command runs: ``--help`` must answer at once."""

import atexit
import gc
import os
import signal
import sys
from contextlib import suppress
from typing import Annotated, Any, NoReturn

import typer
import typer.core
from typer.exceptions import TyperException

from semidense.pipeline.cli.commands import compare, match, rectify, run, score, show, submit
from semidense.pipeline.cli.commands.cache.commands import cache_app
from semidense.pipeline.cli.commands.data import commands as data
from semidense.stages.compute.allocator import keep_freed_memory

_COLLECTED_AFTER = 10_000
"""Objects that are made before Python looks for lost ones; by default 700. Modules make hundreds of thousands
that stay. To look through them again and again takes a tenth of a short command's time."""


class _Commands(typer.core.TyperGroup):
    """The commands; one that fails with EOFError is a fault of the program like any other, not a wish to stop."""

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401
        """Run the command; click would say no more than "Aborted!" where a file ended too early."""
        try:
            return super().invoke(ctx)
        except EOFError as error:
            raise RuntimeError("something that was read ended too early") from error


app = typer.Typer(
    cls=_Commands,
    help="Semi-dense stereo matching with two CNNs; every stage is cached.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # rich takes as long to import as all the rest of --help
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"pipeline {version('semidense-stereo')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Take the options that stand before a command."""


for commands in (run, match, score, rectify, compare, show, data, submit):
    commands.register(app)
app.add_typer(cache_app, name="cache")


class _Stopped(BaseException):
    """SIGINT or SIGTERM arrived. Not KeyboardInterrupt: typer would wait for the tasks that still compute."""


def _stop(number: int, _: Any) -> None:  # noqa: ANN401
    raise _Stopped(number)


def command() -> None:
    """Run the command line in a process that ends with it."""
    gc.set_threshold(_COLLECTED_AFTER, *gc.get_threshold()[1:])
    code = 0
    try:
        main()
    except SystemExit as end:
        if isinstance(end.code, str):
            raise
        code = end.code or 0
    atexit._run_exitfuncs()
    _leave(code)  # without this Python takes a second or more to dismantle torch and Numba


def main() -> NoReturn:
    """Run the command line; a user's mistake is one line and exit code 2."""
    _require_streams()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    keep_freed_memory()
    try:
        try:
            code = app(prog_name="pipeline", standalone_mode=False)
        finally:
            sys.stdout.flush()  # what does not fit on a full disk is an error here, and not a word after the end
    except TyperException as mistake:
        _say_mistyped(mistake)
        raise SystemExit(mistake.exit_code) from None
    except _Stopped as stop:
        _leave(128 + int(stop.args[0]))
    except Exception as error:
        from semidense.pipeline.plan.errors import USER_ERRORS, told

        if (line := told(error)) is None:
            raise
        print(f"pipeline: {line}", file=sys.stderr)
        if isinstance(error, OSError) and not isinstance(error, USER_ERRORS) and error.filename is None:
            _leave(2)  # the output is full or closed: the end of Python would try to write again, and say so at length
        raise SystemExit(2) from None
    raise SystemExit(code if isinstance(code, int) else 0)


def _say_mistyped(mistake: TyperException) -> None:
    """Say in one line what is wrong with the words of a command; without any word, all of its help."""
    told, context = mistake.format_message(), getattr(mistake, "ctx", None)
    helps = f"; see `{context.command_path} --help`" if context else ""
    print(told if "\n" in told else f"pipeline: {told.rstrip('.')}{helps}", file=sys.stderr)


def _require_streams() -> None:
    """Give messages an open stream, and refuse to work if results have no open one."""
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115, PTH123 - it takes the place of the closed one, for good
    if sys.stdout is None:
        print("pipeline: standard output is closed: results have nowhere to go", file=sys.stderr)
        raise SystemExit(2)


def _leave(code: int) -> NoReturn:
    """Exit at once: drafts are deleted by now, and tasks that still compute have nothing left to write to."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:  # as it is of a standard output that is closed
            with suppress(OSError):
                stream.flush()
    os._exit(code)
