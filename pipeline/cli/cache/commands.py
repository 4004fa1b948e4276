"""The `cache` commands. Like `semidense.pipeline.cli.main`: nothing heavy is imported before a command runs."""

from pathlib import Path
from typing import Annotated

import typer

from semidense.pipeline.cli.options import CacheOption, JsonOption

cache_app = typer.Typer(help="Look into the cache, check, clean and share it.", no_args_is_help=True)

KeysArgument = Annotated[list[str] | None, typer.Argument(metavar="[KEY]...", help="Keys, or the start of them.")]
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

    Product, scene, size, age, last use, the settings they belong to, key.
    """
    from semidense.pipeline.cli.cache.listing import Selection, list_entries

    list_entries(cache, Selection(tuple(keys or ()), product, scene), as_json)


@cache_app.command("verify")
def cache_verify(
    keys: KeysArgument = None,
    product: ProductOption = None,
    scene: OnlySceneOption = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compare every byte with what was published.

    Of all entries, or of some; the exit code is 1 if one is damaged.
    """
    from semidense.pipeline.cli.cache.listing import Selection, verify_entries

    if not verify_entries(cache, Selection(tuple(keys or ()), product, scene), as_json):
        raise typer.Exit(1)


@cache_app.command("size")
def cache_size(cache: CacheOption = None, as_json: JsonOption = False) -> None:
    """Say how much space each product takes."""
    from semidense.pipeline.cli.cache.listing import print_sizes

    print_sizes(cache, as_json)


@cache_app.command("gc")
def cache_gc(
    keep: Annotated[
        list[str] | None,
        typer.Option("--keep", metavar="DATASET", help="Keep what a run of it reaches; may be repeated."),
    ] = None,
    config: Annotated[
        list[Path] | None, typer.Option("--config", help="Keep it as this TOML file sets it; may be repeated.")
    ] = None,
    train: Annotated[bool, typer.Option("--train", help="Keep it as run with --train.")] = False,
    unused_for: Annotated[
        str | None, typer.Option("--unused-for", metavar="AGE", help="Only entries unused for this long: 30d, 12h.")
    ] = None,
    max_size: Annotated[
        str | None, typer.Option("--max-size", metavar="SIZE", help="Only as many as bring the cache to this: 20GB.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Delete; without it, only show what would be deleted.")] = False,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what can be deleted and why; delete with --yes.

    Leftovers always; entries by reach, age or size.
    """
    from semidense.pipeline.cli.cache.cleaning import Wish, clean

    wish = Wish(tuple(keep or ()), tuple(config or ()), train, unused_for, max_size)
    clean(cache, wish, yes=yes, as_json=as_json)


@cache_app.command("export")
def cache_export(
    archive: Annotated[Path, typer.Argument(help="The file to write, such as volumes.tar.")],
    keys: KeysArgument = None,
    product: ProductOption = None,
    scene: OnlySceneOption = None,
    inputs: Annotated[bool, typer.Option("--inputs", help="Also all that the entries were made from.")] = False,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write entries, each checked, into one file to pass on."""
    from semidense.pipeline.cli.cache.listing import Selection
    from semidense.pipeline.cli.cache.sharing import export_archive

    export_archive(cache, Selection(tuple(keys or ()), product, scene), archive, inputs=inputs, as_json=as_json)


@cache_app.command("import")
def cache_import(
    archive: Annotated[Path, typer.Argument(help="A file that `cache export` wrote.")],
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Take over the entries of an archive.

    Each is checked to the byte, and is there whole or not at all.
    """
    from semidense.pipeline.cli.cache.sharing import import_archive

    import_archive(cache, archive, as_json)


@cache_app.command("trace")
def cache_trace(
    key: Annotated[str, typer.Argument(help="A key, or the start of one; `cache ls` shows them.")],
    graph: Annotated[Path | None, typer.Option("--graph", help="Draw it into this file (SVG, PNG, PDF).")] = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what an entry was made from.

    Up to images, weights and code.
    """
    from semidense.pipeline.cli.cache.sharing import trace

    trace(cache, key, graph, as_json)
