"""Share entries with a colleague as an archive, and tell what an entry was made from."""

from pathlib import Path

from semidense.cache.upkeep.archive import export_entries, import_entries
from semidense.pipeline.api import open_store
from semidense.pipeline.cli.commands.cache.listing import Selection
from semidense.pipeline.cli.console import print_json
from semidense.pipeline.results.provenance import Provenance, ancestry, tree_lines
from semidense.pipeline.results.text import bytes_text, counted, results


def export_archive(folder: str | None, selection: Selection, target: Path, *, inputs: bool, as_json: bool) -> None:
    """Write the selected entries into an archive, with ``inputs`` also all that they were made from.

    Raises:
        UsageError: if nothing is selected.
        CacheError: if an entry is damaged, or the file cannot be written.
    """
    store = open_store(folder)
    selected = selection.require(store)
    keys = {entry.key for entry in selected}
    if inputs:
        provenance = Provenance(store.entries())
        behind = (each for entry in selected for each in provenance.ancestors(entry))
        keys |= {each.entry.key for each in behind if each.entry}
    entries = export_entries(store, keys, target)
    size = sum(entry.size for entry in entries)
    if as_json:
        print_json({"archive": str(target), "entries": [entry.key for entry in entries], "bytes": size})
    else:
        results().print(
            f"wrote {counted(len(entries), 'entry', 'entries')}, {bytes_text(size)}, to {target}", markup=False
        )


def import_archive(folder: str | None, source: Path, as_json: bool) -> None:
    """Take over the entries of an archive, and say what became of each.

    Raises:
        CacheError: naming what is wrong with the archive; the entries before that are there.
    """
    counts: dict[str, int] = {}
    rows = []
    for each in import_entries(open_store(folder), source):
        counts[each.outcome] = counts.get(each.outcome, 0) + 1
        rows.append({**each.entry.label, "key": each.entry.key, "outcome": each.outcome})
    if as_json:
        print_json({"archive": str(source), "entries": rows})
    else:
        told = ", ".join(f"{count} {outcome}" for outcome, count in counts.items())
        results().print(f"{counted(len(rows), 'entry', 'entries')} checked: {told or 'it holds none'}", markup=False)


def trace(folder: str | None, key: str, graph: Path | None, as_json: bool) -> None:
    """Print, and draw if asked to, what an entry was made from.

    Raises:
        UsageError: if no entry, or several, have such a key.
    """
    store = open_store(folder)
    (entry,) = Selection((key,)).require(store)
    chain = ancestry(store, entry.key)
    if graph:
        from semidense.pipeline.figures.provenance import save_graph

        save_graph(chain, graph)
    if as_json:
        print_json({"key": entry.key, "provenance": [each.to_dict() for each in chain]})
        return
    for line in tree_lines(chain):
        results().print(line, markup=False, soft_wrap=True)
    if graph:
        results().print(f"wrote {graph}", markup=False)
