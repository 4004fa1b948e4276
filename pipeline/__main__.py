"""Run the command line: ``python -m semidense.pipeline`` is ``pipeline``."""

from semidense.pipeline.cli.main import command

command()
