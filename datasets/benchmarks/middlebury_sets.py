"""Say what Middlebury offers: the evaluation of version 3, and the sets of each year.

Sizes: the evaluation in quarter (Q), half (H) and full (F) size; 2005 and 2006 in third, half and full size, as pairs
or (``-grid``) as seven views under three lightings and three exposures.
"""

from semidense.datasets.benchmarks.copies.publication import Publication, Source

_SITE = "https://vision.middlebury.edu/stereo"
_LICENCE = "for research, to be cited"
_PAPERS = {
    "2001": "Scharstein & Szeliski, IJCV 2002",
    "2003": "Scharstein & Szeliski, CVPR 2003",
    "2005": "Scharstein & Pal, CVPR 2007; Hirschmüller & Scharstein, CVPR 2007",
    "2006": "Scharstein & Pal, CVPR 2007; Hirschmüller & Scharstein, CVPR 2007",
    "2014": "Scharstein et al., GCPR 2014",
    "2021": "Scharstein et al., GCPR 2014",
}
_2001 = ("barn1", "barn2", "bull", "poster", "sawtooth", "venus")
_TSUKUBA = ("scene1.row3.col3.ppm", "scene1.row3.col4.ppm", "truedisp.row3.col3.pgm")
_2005 = ("Art", "Books", "Dolls", "Laundry", "Moebius", "Reindeer")
_2006 = (
    *("Aloe", "Baby1", "Baby2", "Baby3", "Bowling1", "Bowling2", "Cloth1", "Cloth2", "Cloth3", "Cloth4", "Flowerpots"),
    *("Lampshade1", "Lampshade2", "Midd1", "Midd2", "Monopoly", "Plastic", "Rocks1", "Rocks2", "Wood1", "Wood2"),
)
_2014 = (
    *("Adirondack", "Backpack", "Bicycle1", "Cable", "Classroom1", "Couch", "Flowers", "Jadeplant", "Mask"),
    *("Motorcycle", "Piano", "Pipes", "Playroom", "Playtable", "Recycle", "Shelves", "Shopvac", "Sticks", "Storage"),
    *("Sword1", "Sword2", "Umbrella", "Vintage"),
)
_SIZES = {"": "ThirdSize", "-half": "HalfSize", "-full": "FullSize"}


def _year(
    name: str, year: str, files: dict[str, str], below: str = "", megabytes: int | None = None, confirmed: bool = True
) -> Publication:
    """Return a set of a year: its files by their path on the site, each with its folder below the year's."""
    root = f"middlebury/{year}"
    return Publication(
        name=name,
        spec=f"middlebury:{root}/{below}".rstrip("/"),
        sources=tuple(
            Source(f"{_SITE}/data/scenes{year}/{path}", f"{root}/{folder}".rstrip("/"))
            for path, folder in files.items()
        ),
        licence=_LICENCE,
        cite=_PAPERS[year],
        home=f"{_SITE}/data/scenes{year}/",
        megabytes=megabytes,
        confirmed=confirmed,
    )


def _evaluation(size: str) -> Publication:
    return Publication(
        name=f"middeval3-{size.lower()}",
        spec=f"middlebury:middlebury/MiddEval3/training{size}",
        sources=tuple(
            Source(f"{_SITE}/submit3/zip/MiddEval3-{part}-{size}.zip", "middlebury") for part in ("data", "GT0", "GT1")
        ),
        licence=_LICENCE,
        cite=_PAPERS["2014"],
        home=f"{_SITE}/submit3/",
    )


def _of_2001() -> Publication:
    names = ("im2.ppm", "im6.ppm", "disp2.pgm", "disp6.pgm")
    files = {f"data/{scene}/{name}": scene for scene in _2001 for name in names}
    return _year("middlebury2001", "2001", files | {f"data/tsukuba/{name}": "tsukuba" for name in _TSUKUBA})


def _pairs(year: str, suffix: str, size: str) -> Publication:
    return _year(f"middlebury{year}{suffix}", year, {f"{size}/zip-2views/ALL-2views.zip": size}, size)


def _grid(year: str, scenes: tuple[str, ...], suffix: str, size: str) -> Publication:
    files = {f"{size}/zip-7views/{scene}-7views.zip": f"grid/{size}" for scene in scenes}
    return _year(f"middlebury{year}{suffix}-grid", year, files, f"grid/{size}", confirmed=False)


PUBLICATIONS = (
    _of_2001(),
    _year("middlebury2003", "2003", {f"newdata/{scene}/{scene}-png-2.zip": "" for scene in ("cones", "teddy")}),
    *(_pairs(year, *size) for year in ("2005", "2006") for size in _SIZES.items()),
    *(_grid(year, scenes, *size) for year, scenes in (("2005", _2005), ("2006", _2006)) for size in _SIZES.items()),
    _year("middlebury2014", "2014", {f"zip/{scene}-perfect.zip": "" for scene in _2014}, megabytes=2100),
    _year(
        "middlebury2014-imperfect",
        "2014",
        {f"zip/{scene}-imperfect.zip": "imperfect" for scene in _2014},
        below="imperfect",
        megabytes=1450,
    ),
    _year("middlebury2021", "2021", {"zip/all.zip": ""}, megabytes=404),
    *(_evaluation(size) for size in ("Q", "H", "F")),
)
