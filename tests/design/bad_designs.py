"""Design files that must be refused, as data; `tests/messages.txt` holds what is said of each.

`BAD_DESIGNS` serves the library's tests and the command line's: both put a file (or what stands in its
place) into a folder with `put` and expect one message.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

FILE_NAME = "bad.toml"

GOOD: Mapping[str, str] = {
    "schema_version": "1",
    "name": '"bad"',
    "cavity.length_mm": "32.0",
    "cavity.width_mm": "32.0",
    "cavity.clear_thickness_mm": "8.0",
    "mold.outer_length_mm": "45.0",
    "mold.outer_width_mm": "45.0",
    "elastomer.mixing_ratio": "20.0",
    "elastomer.viscoelastic.relaxed_share": "0.2",
    "elastomer.viscoelastic.time_constant_s": "5.0",
    "emitters.part": '"sunled-xscwd23mb"',
    "emitters.height_mm": "5.0",
    "receivers.part": '"osram-sfh206k"',
    "receivers.height_mm": "6.0",
}
"""Dotted path and TOML literal of a small design without a fault; `RING` is its layout."""

RING = '[[layout]]\npattern = "alternating_ring"\nparts_per_side = 4\n'

FACING = '[[layout]]\npattern = "facing_rows"\ncount = 2\npitch_mm = 10.0\n'


@dataclass(frozen=True, kw_only=True)
class BadDesign:
    """A file that is no usable design.

    Attributes
    ----------
    id : what is wrong with it
    content : bytes of the file; None for no file at all
    beside : other files in its folder, by name
    is_folder : a folder stands where the file should be
    """

    id: str
    content: bytes | None
    beside: Mapping[str, str] = field(default_factory=dict)
    is_folder: bool = False


def design_text(
    changes: Mapping[str, str | None] | None = None, *, layout: str = RING, head: str = "", tail: str = ""
) -> str:
    """TOML text of the good design with literals changed, added, or left out (None)."""
    values = {**GOOD, **(changes or {})}
    tables: dict[str, list[str]] = {"": []}
    for path, literal in values.items():
        table, _, key = path.rpartition(".")
        if literal is not None:
            tables.setdefault(table, []).append(f"{key} = {literal}")
    top = "\n".join([head, *tables.pop("")])
    rest = "\n".join(f"[{table}]\n" + "\n".join(lines) for table, lines in tables.items())
    return f"{top}\n{rest}\n{layout}\n{tail}\n"


def put(bad: BadDesign, folder: Path) -> Path:
    """Write the file, and what lies beside it, into a folder; the path to open."""
    path = folder / FILE_NAME
    for name, text in bad.beside.items():
        (folder / name).write_text(text, encoding="utf-8")
    if bad.is_folder:
        path.mkdir()
    elif bad.content is not None:
        path.write_bytes(bad.content)
    return path


def _field(path: str, literal: str | None) -> BadDesign:
    """One field of the good design changed."""
    shown = "missing" if literal is None else literal
    return _text(f"{path} = {shown[:70]}", design_text({path: literal}))


def _layout(id_: str, layout: str) -> BadDesign:
    return _text(id_, design_text(layout=layout))


def _text(id_: str, text: str) -> BadDesign:
    return BadDesign(id=id_, content=text.encode())


def _single(kind: str, wall: str, along_mm: float, extra: str = "") -> str:
    return (
        f'[[layout]]\npattern = "single"\nkind = "{kind}"\nwall = "{wall}"\nalong_mm = {along_mm}\n{extra}\n'
    )


def _per_side(kind: str, counts: str) -> str:
    return f'[[layout]]\npattern = "per_side"\nkind = "{kind}"\n{counts}\n'


_FILES = (
    BadDesign(id="no such file", content=None),
    BadDesign(id="a folder", content=None, is_folder=True),
    BadDesign(id="empty", content=b""),
    BadDesign(id="blank", content=b" \n\t\n"),
    BadDesign(id="huge", content=b"# padding\n" * 150_000),
    BadDesign(id="binary", content=bytes(range(256))),
    BadDesign(id="latin-1", content=design_text({"description": '"Gr\u00f6\u00dfe"'}).encode("latin-1")),
    BadDesign(id="utf-16", content=design_text().encode("utf-16")),
    BadDesign(id="null bytes", content=b"\0" * 64),
    BadDesign(id="half a line", content=b"schema_version = \n"),
    BadDesign(id="JSON", content=b'{"schema_version": 1}'),
    BadDesign(id="key twice", content=b"name = 'a'\nname = 'b'\n"),
    BadDesign(id="decimal comma", content=b"a = 32,0\n"),
    BadDesign(id="a unit", content=b"a = 32 mm\n"),
    BadDesign(id="Python's truth", content=b"a = True\n"),
    BadDesign(id="no quotes", content=b"name = pad\n"),
    *(
        BadDesign(id=line, content=f"schema_version = 1\n{line}\n".encode())
        for line in (
            'a = "D:\\parts\\x.toml"',
            "a = \u201cpad\u201d",
            "a =\u00a032",
            "a: 32.0",
            "a 32.0",
            "a = .5",
            "a = 5.",
            "a = 032.0",
            "a = 32.0,",
            'a = "x",',
            "a = 32.0;",
            "a = 32.0 // wide",
            "// wide",
            "a = 45\u00b0",
            "a = None",
            "a = yes",
            "[[layout]",
        )
    ),
    BadDesign(id="no end quote", content=b'a = "pad'),
    BadDesign(id="a tab for a folder", content=b'schema_version = 1\ncatalog_files = ["sub\\table.toml"]\n'),
    BadDesign(id="nested too deep", content=b"a = " + b"[" * 20_000),
    BadDesign(id="a number of 5000 digits", content=design_text({"cavity.length_mm": "9" * 5000}).encode()),
)

_VERSIONS = (
    _field("schema_version", None),
    _field("schema_version", "2"),
    _field("schema_version", "999999999999"),
    _field("schema_version", "0"),
    _field("schema_version", "-1"),
    _field("schema_version", '"1"'),
    _field("schema_version", "true"),
    _field("schema_version", "1.0"),
)

_NAMES = (
    _field("name", None),
    _field("name", '""'),
    _field("name", '"../../x"'),
    _field("name", '"/etc/x"'),
    _field("name", "'a\\b'"),
    _field("name", '".hidden"'),
    _field("name", '"a b"'),
    _field("name", '"a\\nb"'),
    _field("name", '"a\\u0000b"'),
    _field("name", f'"{"x" * 300}"'),
    _field("name", "7"),
)

_VALUES = (
    _field("cavity.length_mm", None),
    _field("cavity.length_mm", '"32"'),
    _field("cavity.length_mm", '"32 mm"'),
    _field("gain.feedback_ohm", '"comon"'),
    _field("mold.label", f'"{"x" * 41}"'),
    _field("cavity.length_mm", "true"),
    _field("cavity.length_mm", "nan"),
    _field("cavity.length_mm", "inf"),
    _field("cavity.length_mm", "-inf"),
    _field("cavity.length_mm", "0.032"),
    _field("cavity.length_mm", "32000.0"),
    _field("cavity.length_mm", "1979-05-27"),
    _field("cavity.length_mm", "[32.0]"),
    _field("cavity.length_mm", "{mm = 32.0}"),
    _field("cavity.length_mm", "9" * 400),
    _field("cavity.clear_thickness_mm", "0.008"),
    _field("cavity.clear_thickness_mm", "8000"),
    _field("emitters.height_mm", "0.005"),
    _field("emitters.height_mm", "5000.0"),
    _field("emitters.height_mm", "-1.0"),
    _field("operating.max_depth_mm", "0.005"),
    _field("operating.max_depth_mm", "5000.0"),
    _field("elastomer.mixing_ratio", "0.0"),
    _field("surfaces.wall_reflectance", "5.0"),
    _field("surfaces.wall_reflectance", "-0.1"),
    _field("board.adc_prescaler", "64.5"),
    _field("board.adc_prescaler", '"64"'),
    _field("board.baud", "9" * 30),
    _field("board.emitter_pins", "[22, -1]"),
    _field("board.emitter_pins", '["22"]'),
    _field("cavity.lenght_mm", "32.0"),
    _field("mold.material", '"PLA black"'),
    _field("board.kind", '"teensy-4.1"'),
    _field("colour", '"red"'),
    _field("measured", '["emitters.hieght_mm"]'),
    _field("measured", '["emitters"]'),
    _field("measured", '["layout.7.height_mm"]'),
    _text("cavity is a number", design_text(layout="").replace("[cavity]", "cavity = 3\n[cavit]")),
)

_LAYOUTS = (
    _layout("no layout", ""),
    _layout("layout of one table", "[layout]\ncount = 3\n"),
    _text("empty layout", design_text(head="layout = []", layout="")),
    _layout("layout without pattern", "[[layout]]\ncount = 3\n"),
    _layout("unknown pattern", '[[layout]]\npattern = "spiral"\n'),
    _layout("misspelt wall", '[[layout]]\npattern = "facing_rows"\nemitter_wall = "wset"\ncount = 2\n'),
    _layout("negative count", '[[layout]]\npattern = "facing_rows"\ncount = -3\n'),
    _layout("count of half a part", '[[layout]]\npattern = "facing_rows"\ncount = 2.5\n'),
    _layout("a count in words", '[[layout]]\npattern = "facing_rows"\ncount = "two"\n'),
    _layout("three sides", '[[layout]]\npattern = "alternating_ring"\nparts_per_side = [4, 4, 4]\n'),
    _layout("an odd ring", '[[layout]]\npattern = "alternating_ring"\nparts_per_side = [4, 4, 4, 3]\n'),
    _layout("pitch in metres", '[[layout]]\npattern = "facing_rows"\ncount = 2\npitch_mm = 0.0065\n'),
    _layout(
        "pitch larger than the wall", '[[layout]]\npattern = "facing_rows"\ncount = 2\npitch_mm = 40.0\n'
    ),
    _layout("no receiver", _per_side("emitter", "south = 2")),
    _layout("no emitter", _per_side("receiver", "south = 2")),
    _layout("parts on no wall", _per_side("emitter", "")),
    _layout("all parts in one wall", _single("emitter", "south", 8.0) + _single("receiver", "south", 22.0)),
    _layout(
        "two parts at one place",
        _single("emitter", "south", 16.0) + _single("receiver", "south", 17.0) + FACING,
    ),
    _layout("a name twice", FACING + _single("emitter", "north", 16.0, 'name = "E1"')),
    _layout("a part past the corner", FACING + _single("emitter", "north", 31.5)),
    _layout("a part beyond the wall", FACING + _single("emitter", "north", 299.0)),
    _layout("a place of a kilometre", FACING + _single("emitter", "north", 1e6)),
    _layout("500 parts", _per_side("emitter", "south = 32\neast = 32\nnorth = 32\nwest = 32") * 4),
    _layout("500 patterns", _single("emitter", "south", 16.0) * 500),
    _layout("a million parts", '[[layout]]\npattern = "alternating_ring"\nparts_per_side = 1000000\n'),
    _layout("a part of the wrong kind", FACING + _single("emitter", "north", 16.0, 'part = "osram-sfh206k"')),
    _layout("a path as a name", FACING + _single("emitter", "north", 16.0, 'name = "../E"')),
)

_REFERENCES = (
    _field("emitters.part", '"sunled-xscwd23"'),
    _field("receivers.part", '"osram-sfh20k"'),
    _field("receivers.part", '"no/such"'),
    _field("elastomer.material", '"sylgard-148"'),
    _field("mold.material", '"abs-balck"'),
    _field("board.kind", '"arduino-mega"'),
    _field("elastomer.mixing_ratio", "99.0"),
    _text(
        "a measurement of no part",
        design_text(tail="[part_measurements.osram-sfh206]\nactive_width_mm = 2.6"),
    ),
    _text("a measurement of nothing", design_text(tail="[part_measurements.osram-sfh206k]\n")),
    _text(
        "a measurement of no field",
        design_text(tail="[part_measurements.osram-sfh206k]\nactive_widht_mm = 2.6"),
    ),
    _text(
        "a measurement in metres",
        design_text(tail="[part_measurements.osram-sfh206k]\nactive_width_mm = -2.6"),
    ),
    _text(
        "a measured chip wider than its body",
        design_text(tail="[part_measurements.osram-sfh206k]\nactive_width_mm = 26.0"),
    ),
)

_CATALOGUES = (
    _text("a catalogue outside the folder", design_text(head='catalog_files = ["../parts.toml"]')),
    _text("a catalogue by full path", design_text(head='catalog_files = ["/etc/hostname"]')),
    _text("a catalogue with a null byte", design_text(head='catalog_files = ["a\\u0000b"]')),
    _text("a missing catalogue", design_text(head='catalog_files = ["parts.toml"]')),
    _text("a catalogue that is no list", design_text(head='catalog_files = "parts.toml"')),
    _text("a catalogue of numbers", design_text(head="catalog_files = [1]")),
    _text("the folder as a catalogue", design_text(head='catalog_files = ["."]')),
    BadDesign(
        id="a bad entry in a catalogue",
        content=design_text(head='catalog_files = ["parts.toml"]').encode(),
        beside={"parts.toml": '[parts.mine]\nkind = "emitter"\n'},
    ),
    BadDesign(
        id="a catalogue of the wrong form",
        content=design_text(head='catalog_files = ["parts.toml"]').encode(),
        beside={"parts.toml": "[party]\n"},
    ),
    _text("a bad entry in the design", design_text(tail='[catalog.mold_materials.mine]\ntitle = "Mine"\n')),
)

_OPTICS = (
    _field("surfaces.wall_finish", '"matt"'),
    _field("surfaces.wall_index", "0.9"),
    _field("surfaces.wall_index", "1.5"),
    _text("epoxy thinner than air", design_text(tail="[part_measurements.osram-sfh206k]\nepoxy_index = 0.5")),
    _text("epoxy on an emitter", design_text(tail="[part_measurements.sunled-xscwd23mb]\nepoxy_index = 1.5")),
)

_FITS = (
    _field("mold.outer_length_mm", "33.0"),
    _field("mold.outer_width_mm", "20.0"),
    _field("mold.floor_mm", "0.0"),
    _field("mold.fixing_hole_inset_mm", "6.0"),
    _field("mold.fixing_hole_inset_mm", "1.0"),
    _field("receivers.height_mm", "9.0"),
    _field("operating.workspace_margin_mm", "14.0"),
    _field("operating.max_depth_mm", "8.5"),
    _field("indenter.tip_radius_mm", "0.003"),
)

_PROFILE = {"indenter.shape": '"profile"'}

_TIPS = (
    _field("indenter.shape", '"ball"'),
    _field("indenter.edge_radius_mm", "0.3"),
    _field("indenter.profile_mm", "[[0.0, 0.0], [3.0, 1.0]]"),
    _text(
        "an angle of a flat punch",
        design_text({"indenter.shape": '"flat_punch"', "indenter.cone_half_angle_deg": "60.0"}),
    ),
    _text(
        "an edge wider than its tip",
        design_text({"indenter.shape": '"flat_punch"', "indenter.edge_radius_mm": "3.5"}),
    ),
    _text("a profile without points", design_text(_PROFILE)),
    *(
        _text(what, design_text(_PROFILE | {"indenter.profile_mm": points}))
        for what, points in (
            ("a profile that is no function", "[[0, 0], [2, 1], [1.5, 2], [3, 3]]"),
            ("a profile that falls", "[[0, 0], [2, 1], [3, 0.5]]"),
            ("a profile without an apex", "[[0.1, 0], [3, 0.5]]"),
            ("a profile that misses its shank", "[[0, 0], [2.5, 0.5]]"),
            ("a profile in micrometres", "[[0, 0], [3, 500]]"),
            ("a profile of one point", "[[0, 0]]"),
        )
    ),
    _text(
        "a profile's file outside the folder",
        design_text(_PROFILE | {"indenter.profile_csv": '"../tip.csv"'}),
    ),
    _text("a profile's file that is a number", design_text(_PROFILE | {"indenter.profile_csv": "3"})),
    _text(
        "a profile given twice",
        design_text(
            _PROFILE | {"indenter.profile_csv": '"tip.csv"', "indenter.profile_mm": "[[0, 0], [3, 1]]"}
        ),
    ),
    *(
        BadDesign(
            id=what,
            content=design_text(_PROFILE | {"indenter.profile_csv": '"tip.csv"'}).encode(),
            beside={"tip.csv": text},
        )
        for what, text in (
            ("a profile's file that is no function", "r_mm,height_mm\n0,0\n2,1\n2,2\n3,3\n"),
            ("a profile's file with a word", "0,0\n1,high\n3,2\n"),
            ("a profile's file with a third number", "0,0,1\n3,2,1\n"),
            ("a profile's file without points", "r,h\n"),
            ("a profile's file with no number", "0,0\nnan,1\n3,2\n"),
            ("a profile's file of another radius", "0,0\n4,2\n"),
        )
    ),
)

_BOARD = (
    _field("board.emitter_pins", "[22, 23, 24, 25, 26, 27, 28, 22]"),
    _field("board.emitter_pins", "[22, 23]"),
    _field("board.emitter_pins", "[0, 23, 24, 25, 26, 27, 28, 29]"),
    _field("board.emitter_pins", "[99, 23, 24, 25, 26, 27, 28, 29]"),
    _field("board.emitter_pins", "[54, 23, 24, 25, 26, 27, 28, 29]"),
    _field("board.receiver_channels", '["A0", "A1", "A2", "A3", "A4", "A5", "A6", "D7"]'),
    _field("board.receiver_channels", '["A0", "A1", "A2", "A3", "A4", "A5", "A6", "A0"]'),
    _field("board.adc_prescaler", "63"),
    _field("board.adc_prescaler", "0"),
    _field("board.baud", "230400"),
    _field("board.frame_rate_hz", "400.0"),
    _layout(
        "more receivers than channels",
        _per_side("receiver", "south = 5\neast = 5\nnorth = 5\nwest = 3") + _per_side("emitter", "west = 1"),
    ),
)

BAD_DESIGNS: tuple[BadDesign, ...] = (
    *_FILES,
    *_VERSIONS,
    *_NAMES,
    *_VALUES,
    *_LAYOUTS,
    *_REFERENCES,
    *_CATALOGUES,
    *_OPTICS,
    *_FITS,
    *_TIPS,
    *_BOARD,
)
