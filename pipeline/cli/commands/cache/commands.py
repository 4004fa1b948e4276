"""The `cache` commands. Like `semidense.pipeline.cli.main`: nothing heavy is imported before a command runs."""

from pathlib import Path
from typing import Annotated

import typer

from semidense.pipeline.cli.options import CacheOption, JsonOption

cache_app = typer.Typer(help="List, check, clean and share the entries of the cache.", no_args_is_help=True)

KeysArgument = Annotated[
    list[str] | None, typer.Argument(metavar="[KEY]...", help="Keys of entries, or the first letters of keys.")
]
ProductOption = Annotated[str | None, typer.Option("--product", help="Only entries of this product.")]
OnlySceneOption = Annotated[str | None, typer.Option("--scene", help="Only entries of this scene.")]


@cache_app.command("ls")
def cache_ls(
    keys: KeysArgument = None,
    product: ProductOption = None,
    scene: OnlySceneOption = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """List the entries.

    Each line has product, scene, size, age, last use, the settings that made the entry, and its key.
    """
    from semidense.pipeline.cli.commands.cache.listing import Selection, list_entries

    list_entries(cache, Selection(tuple(keys or ()), product, scene), as_json)


@cache_app.command("verify")
def cache_verify(
    keys: KeysArgument = None,
    product: ProductOption = None,
    scene: OnlySceneOption = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Check that no byte of an entry has changed.

    Checks all entries, or those that are named. The exit code is 1 if one is damaged.
    """
    from semidense.pipeline.cli.commands.cache.listing import Selection, verify_entries

    if not verify_entries(cache, Selection(tuple(keys or ()), product, scene), as_json):
        raise typer.Exit(1)


@cache_app.command("size")
def cache_size(cache: CacheOption = None, as_json: JsonOption = False) -> None:
    """Print how much space each product takes."""
    from semidense.pipeline.cli.commands.cache.listing import print_sizes

    print_sizes(cache, as_json)


@cache_app.command("gc")
def cache_gc(
    keep: Annotated[
        list[str] | None,
        typer.Option("--keep", metavar="DATASET", help="Keep what `pipeline run DATASET` uses; may be repeated."),
    ] = None,
    config: Annotated[
        list[Path] | None, typer.Option("--config", help="Settings of the runs to keep, a TOML file; may be repeated.")
    ] = None,
    preset: Annotated[
        list[str] | None,
        typer.Option("--preset", help="The runs to keep have this preset [default: as of run]; may be repeated."),
    ] = None,
    train: Annotated[bool, typer.Option("--train", help="The runs to keep have --train.")] = False,
    unused_for: Annotated[
        str | None,
        typer.Option("--unused-for", metavar="AGE", help="Delete entries that were not used for this long: 30d, 12h."),
    ] = None,
    max_size: Annotated[
        str | None,
        typer.Option(
            "--max-size",
            metavar="SIZE",
            help="Delete the entries unused for longest, until the cache has this size: 20GB.",
        ),
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Delete; without this option, only show what would be deleted.")
    ] = False,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what can be deleted and why; delete with --yes.

    Leftovers of dead runs and entries of another version can always go. Other entries need --keep, --unused-for or
    --max-size.
    """
    from semidense.pipeline.cli.commands.cache.cleaning import Wish, clean

    wish = Wish(tuple(keep or ()), tuple(config or ()), tuple(preset or ()), train, unused_for, max_size)
    clean(cache, wish, yes=yes, as_json=as_json)


@cache_app.command("export")
def cache_export(
    archive: Annotated[Path, typer.Argument(help="The file to write, such as volumes.tar.")],
    keys: KeysArgument = None,
    product: ProductOption = None,
    scene: OnlySceneOption = None,
    inputs: Annotated[bool, typer.Option("--inputs", help="Also write the entries that these were made from.")] = False,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Check entries and write them into one archive."""
    from semidense.pipeline.cli.commands.cache.listing import Selection
    from semidense.pipeline.cli.commands.cache.sharing import export_archive

    export_archive(cache, Selection(tuple(keys or ()), product, scene), archive, inputs=inputs, as_json=as_json)


@cache_app.command("import")
def cache_import(
    archive: Annotated[Path, typer.Argument(help="A file that `cache export` wrote.")],
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Add the entries of an archive to the cache.

    Every byte is checked. An entry is added whole, or not at all.
    """
    from semidense.pipeline.cli.commands.cache.sharing import import_archive

    import_archive(cache, archive, as_json)


@cache_app.command("trace")
def cache_trace(
    key: Annotated[str, typer.Argument(help="A key, or the start of one; `cache ls` shows them.")],
    graph: Annotated[
        Path | None, typer.Option("--graph", help="Draw the inputs as a graph into this file (SVG, PNG or PDF).")
    ] = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what an entry was made from.

    Follows its inputs back to images, weights and code.
    """
    from semidense.pipeline.cli.commands.cache.sharing import trace

    trace(cache, key, graph, as_json)
