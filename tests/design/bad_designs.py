"""Design files that must be refused, as data: what is wrong, and the words that the refusal must hold.

`BAD_DESIGNS` serves the library's tests and the command line's: both put a file (or what stands in its
place) into a folder with `put` and expect one message that names the field and the value.
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
    words : each must be in the message
    beside : other files in its folder, by name
    is_folder : a folder stands where the file should be
    """

    id: str
    content: bytes | None
    words: tuple[str, ...]
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


def _field(path: str, literal: str | None, *words: str) -> BadDesign:
    """One field of the good design changed; its path must be named."""
    shown = "missing" if literal is None else literal
    return _text(f"{path} = {shown[:70]}", design_text({path: literal}), path, *words)


def _layout(id_: str, layout: str, *words: str) -> BadDesign:
    return _text(id_, design_text(layout=layout), *words)


def _text(id_: str, text: str, *words: str) -> BadDesign:
    return BadDesign(id=id_, content=text.encode(), words=words)


def _single(kind: str, wall: str, along_mm: float, extra: str = "") -> str:
    return (
        f'[[layout]]\npattern = "single"\nkind = "{kind}"\nwall = "{wall}"\nalong_mm = {along_mm}\n{extra}\n'
    )


def _per_side(kind: str, counts: str) -> str:
    return f'[[layout]]\npattern = "per_side"\nkind = "{kind}"\n{counts}\n'


_FILES = (
    BadDesign(id="no such file", content=None, words=("bad.toml", "no such file", "optopad new")),
    BadDesign(id="a folder", content=None, is_folder=True, words=("bad.toml", "folder")),
    BadDesign(id="empty", content=b"", words=("schema_version", "missing")),
    BadDesign(id="blank", content=b" \n\t\n", words=("schema_version", "missing")),
    BadDesign(id="huge", content=b"# padding\n" * 150_000, words=("larger than 1000000 bytes",)),
    BadDesign(id="binary", content=bytes(range(256)), words=("bad.toml", "not UTF-8")),
    BadDesign(
        id="latin-1",
        content=design_text({"description": '"Gr\u00f6\u00dfe"'}).encode("latin-1"),
        words=("not UTF-8", "save it as UTF-8"),
    ),
    BadDesign(id="utf-16", content=design_text().encode("utf-16"), words=("not UTF-8",)),
    BadDesign(id="null bytes", content=b"\0" * 64, words=("binary data", "not UTF-8 text")),
    BadDesign(id="half a line", content=b"schema_version = \n", words=("not valid TOML", "line 1")),
    BadDesign(id="JSON", content=b'{"schema_version": 1}', words=("not valid TOML",)),
    BadDesign(id="key twice", content=b"name = 'a'\nname = 'b'\n", words=("line 2", "name is given twice")),
    BadDesign(id="decimal comma", content=b"a = 32,0\n", words=("line 1", "'a = 32,0'", "decimal point")),
    BadDesign(id="a unit", content=b"a = 32 mm\n", words=("line 1", "'a = 32 mm'", "without its unit")),
    BadDesign(id="Python's truth", content=b"a = True\n", words=("line 1", "small letters")),
    BadDesign(id="no quotes", content=b"name = pad\n", words=("line 1", "in quotes")),
    *(
        BadDesign(id=line, content=f"schema_version = 1\n{line}\n".encode(), words=("line 2", way_out))
        for line, way_out in (
            ('a = "D:\\parts\\x.toml"', "write / for"),
            ("a = \u201cpad\u201d", "straight quotes"),
            ("a =\u00a032", "a special blank"),
            ("a: 32.0", "write = between"),
            ("a 32.0", "write = between"),
            ("a = .5", "write a 0 before"),
            ("a = 5.", "write a digit after"),
            ("a = 032.0", "without zeros before"),
            ("a = 32.0,", "remove the comma"),
            ('a = "x",', "remove the comma"),
            ("a = 32.0;", "nothing follows a value"),
            ("a = 32.0 // wide", "begin a comment with #"),
            ("// wide", "begin a comment with #"),
            ("a = 45\u00b0", "without its unit"),
            ("a = None", "remove the line"),
            ("a = yes", "true or false"),
            ("[[layout]", "an entry of a list as [[layout]]"),
        )
    ),
    BadDesign(
        id="no end quote", content=b'a = "pad', words=("end of document", "end the text with its quote")
    ),
    BadDesign(
        id="a tab for a folder",
        content=b'schema_version = 1\ncatalog_files = ["sub\\table.toml"]\n',
        words=("write / between",),
    ),
    BadDesign(id="nested too deep", content=b"a = " + b"[" * 20_000, words=("nested too deep",)),
    BadDesign(
        id="a number of 5000 digits",
        content=design_text({"cavity.length_mm": "9" * 5000}).encode(),
        words=("not valid TOML", "digits"),
    ),
)

_VERSIONS = (
    _field("schema_version", None, "missing", "schema_version = 1"),
    _field("schema_version", "2", "newer", "update optopad"),
    _field("schema_version", "999999999999", "999999999999", "newer"),
    _field("schema_version", "0", "no version"),
    _field("schema_version", "-1", "-1", "no version"),
    _field("schema_version", '"1"', "'1'", "no version"),
    _field("schema_version", "true", "True", "no version"),
    _field("schema_version", "1.0", "1.0", "no version"),
)

_NAMES = (
    _field("name", None, "missing"),
    _field("name", '""', "''", "no folders"),
    _field("name", '"../../x"', "../../x", "no folders"),
    _field("name", '"/etc/x"', "/etc/x", "no folders"),
    _field("name", "'a\\b'", "a\\\\b", "no folders"),
    _field("name", '".hidden"', ".hidden"),
    _field("name", '"a b"', "a b"),
    _field("name", '"a\\nb"', "a\\nb"),
    _field("name", '"a\\u0000b"', "a\\x00b"),
    _field("name", f'"{"x" * 300}"', "xxx..."),
    _field("name", "7", "7", "text"),
)

_VALUES = (
    _field("cavity.length_mm", None, "missing", "add it"),
    _field("cavity.length_mm", '"32"', "'32'", "number"),
    _field("cavity.length_mm", '"32 mm"', "'32 mm'", "number, without unit"),
    _field("gain.feedback_ohm", '"comon"', "'comon'", " or must be 'common'"),
    _field("mold.label", f'"{"x" * 41}"', "must have at most 40 characters"),
    _field("cavity.length_mm", "true", "True", "number"),
    _field("cavity.length_mm", "nan", "finite"),
    _field("cavity.length_mm", "inf", "finite"),
    _field("cavity.length_mm", "-inf", "finite"),
    _field("cavity.length_mm", "0.032", "0.032", "at least 5 mm", "metres"),
    _field("cavity.length_mm", "32000.0", "32000.0", "at most 200 mm", "micrometres"),
    _field("cavity.length_mm", "1979-05-27", "1979-05-27", "number"),
    _field("cavity.length_mm", "[32.0]", "[32.0]", "number"),
    _field("cavity.length_mm", "{mm = 32.0}", "number"),
    _field("cavity.length_mm", "9" * 400, "999...", "finite"),
    _field("cavity.clear_thickness_mm", "0.008", "0.008", "metres"),
    _field("cavity.clear_thickness_mm", "8000", "8000", "micrometres"),
    _field("emitters.height_mm", "0.005", "sticks out below", "millimetres"),
    _field("emitters.height_mm", "5000.0", "5000.0", "micrometres"),
    _field("emitters.height_mm", "-1.0", "-1.0", "above 0 mm"),
    _field("operating.max_depth_mm", "0.005", "0.005", "at least 0.1 mm"),
    _field("operating.max_depth_mm", "5000.0", "5000.0", "at most 30 mm"),
    _field("elastomer.mixing_ratio", "0.0", "0.0", "above 0"),
    _field("surfaces.wall_reflectance", "5.0", "5.0", "at most 0.99"),
    _field("surfaces.wall_reflectance", "-0.1", "-0.1", "at least 0"),
    _field("board.adc_prescaler", "64.5", "64.5", "whole number"),
    _field("board.adc_prescaler", '"64"', "'64'", "whole number"),
    _field("board.baud", "9" * 30, "999"),
    _field("board.emitter_pins", "[22, -1]", "-1", "at least 0"),
    _field("board.emitter_pins", '["22"]', "'22'", "whole number"),
    _field("cavity.lenght_mm", "32.0", "did you mean cavity.length_mm"),
    _field("mold.material", '"PLA black"', "small letters, digits", "did you mean pla-black?"),
    _field("board.kind", '"teensy-4.1"', "small letters, digits"),
    _field("colour", '"red"', "spelling"),
    _field("measured", '["emitters.hieght_mm"]', "emitters.height_mm"),
    _field("measured", '["emitters"]', "emitters"),
    _field("measured", '["layout.7.height_mm"]', "layout.7.height_mm"),
    _text("cavity is a number", design_text(layout="").replace("[cavity]", "cavity = 3\n[cavit]"), "cavity"),
)

_LAYOUTS = (
    _layout("no layout", "", "layout", "missing"),
    _layout("layout of one table", "[layout]\ncount = 3\n", "layout", "write [[layout]]"),
    _text("empty layout", design_text(head="layout = []", layout=""), "layout", "at least 1"),
    _layout("layout without pattern", "[[layout]]\ncount = 3\n", "layout.0", "pattern", "facing_rows"),
    _layout("unknown pattern", '[[layout]]\npattern = "spiral"\n', "layout.0", "spiral", "facing_rows"),
    _layout(
        "misspelt wall",
        '[[layout]]\npattern = "facing_rows"\nemitter_wall = "wset"\ncount = 2\n',
        "layout.0.emitter_wall",
        "'wset'",
        "'west'",
    ),
    _layout("negative count", '[[layout]]\npattern = "facing_rows"\ncount = -3\n', "layout.0.count", "-3"),
    _layout(
        "count of half a part", '[[layout]]\npattern = "facing_rows"\ncount = 2.5\n', "layout.0.count", "2.5"
    ),
    _layout(
        "a count in words", '[[layout]]\npattern = "facing_rows"\ncount = "two"\n', "layout.0.count", "two"
    ),
    _layout(
        "three sides",
        '[[layout]]\npattern = "alternating_ring"\nparts_per_side = [4, 4, 4]\n',
        "layout.0.parts_per_side",
    ),
    _layout(
        "an odd ring",
        '[[layout]]\npattern = "alternating_ring"\nparts_per_side = [4, 4, 4, 3]\n',
        "layout.0",
        "15",
        "even",
    ),
    _layout(
        "pitch in metres",
        '[[layout]]\npattern = "facing_rows"\ncount = 2\npitch_mm = 0.0065\n',
        "layout.0.pitch_mm",
        "0.0065",
        "metres",
    ),
    _layout(
        "pitch larger than the wall",
        '[[layout]]\npattern = "facing_rows"\ncount = 2\npitch_mm = 40.0\n',
        "layout.0",
        "west wall",
        "32 mm",
    ),
    _layout("no receiver", _per_side("emitter", "south = 2"), "layout", "no receiver"),
    _layout("no emitter", _per_side("receiver", "south = 2"), "layout", "no emitter"),
    _layout("parts on no wall", _per_side("emitter", ""), "layout", "no emitter"),
    _layout(
        "all parts in one wall",
        _single("emitter", "south", 8.0) + _single("receiver", "south", 22.0),
        "layout",
        "direct path",
        "south",
    ),
    _layout(
        "two parts at one place",
        _single("emitter", "south", 16.0) + _single("receiver", "south", 17.0) + FACING,
        "layout",
        "E1 and R1",
        "overlap",
    ),
    _layout(
        "a name twice",
        FACING + _single("emitter", "north", 16.0, 'name = "E1"'),
        "layout.1",
        "name E1",
    ),
    _layout("a part past the corner", FACING + _single("emitter", "north", 31.5), "layout.1", "north wall"),
    _layout("a part beyond the wall", FACING + _single("emitter", "north", 299.0), "layout.1", "north wall"),
    _layout(
        "a place of a kilometre", FACING + _single("emitter", "north", 1e6), "layout.1.along_mm", "1000000.0"
    ),
    _layout(
        "500 parts",
        _per_side("emitter", "south = 32\neast = 32\nnorth = 32\nwest = 32") * 4,
        "layout",
        "512",
        "64",
    ),
    _layout("500 patterns", _single("emitter", "south", 16.0) * 500, "layout", "at most 128"),
    _layout(
        "a million parts",
        '[[layout]]\npattern = "alternating_ring"\nparts_per_side = 1000000\n',
        "layout.0.parts_per_side",
        "1000000",
    ),
    _layout(
        "a part of the wrong kind",
        FACING + _single("emitter", "north", 16.0, 'part = "osram-sfh206k"'),
        "layout.1.part",
        "receiver",
    ),
    _layout(
        "a path as a name",
        FACING + _single("emitter", "north", 16.0, 'name = "../E"'),
        "layout.1.name",
        "../E",
    ),
)

_REFERENCES = (
    _field("emitters.part", '"sunled-xscwd23"', "sunled-xscwd23mb"),
    _field("receivers.part", '"osram-sfh20k"', "osram-sfh206k"),
    _field("receivers.part", '"no/such"', "no/such"),
    _field("elastomer.material", '"sylgard-148"', "sylgard-184"),
    _field("mold.material", '"abs-balck"', "abs-black"),
    _field("board.kind", '"arduino-mega"', "arduino-mega-2560"),
    _field("elastomer.mixing_ratio", "99.0", "99", "give elastomer.youngs_modulus_mpa"),
    _text(
        "a measurement of no part",
        design_text(tail="[part_measurements.osram-sfh206]\nactive_width_mm = 2.6"),
        "part_measurements.osram-sfh206",
        "osram-sfh206k",
    ),
    _text(
        "a measurement of nothing",
        design_text(tail="[part_measurements.osram-sfh206k]\n"),
        "part_measurements.osram-sfh206k",
        "at least 1",
    ),
    _text(
        "a measurement of no field",
        design_text(tail="[part_measurements.osram-sfh206k]\nactive_widht_mm = 2.6"),
        "part_measurements.osram-sfh206k.active_widht_mm",
        "active_width_mm",
    ),
    _text(
        "a measurement in metres",
        design_text(tail="[part_measurements.osram-sfh206k]\nactive_width_mm = -2.6"),
        "part_measurements.osram-sfh206k.active_width_mm",
        "-2.6",
    ),
    _text(
        "a measured chip wider than its body",
        design_text(tail="[part_measurements.osram-sfh206k]\nactive_width_mm = 26.0"),
        "part_measurements.osram-sfh206k",
        "active_width_mm = 26",
        "body_width_mm",
    ),
)

_CATALOGUES = (
    _text(
        "a catalogue outside the folder",
        design_text(head='catalog_files = ["../parts.toml"]'),
        "catalog_files",
        "../parts.toml",
    ),
    _text(
        "a catalogue by full path",
        design_text(head='catalog_files = ["/etc/hostname"]'),
        "catalog_files",
        "/etc/hostname",
    ),
    _text(
        "a catalogue with a null byte",
        design_text(head='catalog_files = ["a\\u0000b"]'),
        "catalog_files",
        "a\\x00b",
    ),
    _text(
        "a missing catalogue",
        design_text(head='catalog_files = ["parts.toml"]'),
        "parts.toml",
        "no file next to",
    ),
    _text(
        "a catalogue that is no list",
        design_text(head='catalog_files = "parts.toml"'),
        "catalog_files",
        "list",
    ),
    _text("a catalogue of numbers", design_text(head="catalog_files = [1]"), "catalog_files", "[1]"),
    _text(
        "the folder as a catalogue",
        design_text(head='catalog_files = ["."]'),
        "catalog_files",
        "no file next to",
    ),
    BadDesign(
        id="a bad entry in a catalogue",
        content=design_text(head='catalog_files = ["parts.toml"]').encode(),
        beside={"parts.toml": '[parts.mine]\nkind = "emitter"\n'},
        words=("parts.toml", "parts.mine.title", "missing"),
    ),
    BadDesign(
        id="a catalogue of the wrong form",
        content=design_text(head='catalog_files = ["parts.toml"]').encode(),
        beside={"parts.toml": "[party]\n"},
        words=("parts.toml", "party"),
    ),
    _text(
        "a bad entry in the design",
        design_text(tail='[catalog.mold_materials.mine]\ntitle = "Mine"\n'),
        "catalog.mold_materials.mine.wall_reflectance",
        "missing",
    ),
)

_OPTICS = (
    _field("surfaces.wall_finish", '"matt"', "matt", "air_gap"),
    _field("surfaces.wall_index", "0.9", "0.9", "at least 1"),
    _field("surfaces.wall_index", "1.5", "'diffuse'", "wall_finish = 'glossy'"),
    _text(
        "epoxy thinner than air",
        design_text(tail="[part_measurements.osram-sfh206k]\nepoxy_index = 0.5"),
        "part_measurements.osram-sfh206k.epoxy_index",
        "0.5",
        "from 1 to 2.5",
    ),
    _text(
        "epoxy on an emitter",
        design_text(tail="[part_measurements.sunled-xscwd23mb]\nepoxy_index = 1.5"),
        "part_measurements.sunled-xscwd23mb.epoxy_index",
        "no such value",
    ),
)

_FITS = (
    _field("mold.outer_length_mm", "33.0", "socket", "0.50 mm"),
    _field("mold.outer_width_mm", "20.0", "socket", "-6.00 mm"),
    _field("mold.floor_mm", "0.0", "0.0", "at least 0.6 mm"),
    _field("mold.fixing_hole_inset_mm", "6.0", "cavity"),
    _field("mold.fixing_hole_inset_mm", "1.0", "outer face"),
    _field("receivers.height_mm", "9.0", "above the undisturbed surface", "9 mm", "8 mm"),
    _field("operating.workspace_margin_mm", "14.0", "no location is left", "14 mm"),
    _field("operating.max_depth_mm", "8.5", "8.5 mm", "clear_thickness_mm = 8 mm"),
    _field("indenter.tip_radius_mm", "0.003", "0.003", "at least 0.5 mm"),
)

_PROFILE = {"indenter.shape": '"profile"'}

_TIPS = (
    _field("indenter.shape", '"ball"', "ball", "hemisphere"),
    _field("indenter.edge_radius_mm", "0.3", "'flat_punch' or 'cone'", "'hemisphere'"),
    _field("indenter.profile_mm", "[[0.0, 0.0], [3.0, 1.0]]", "'profile'", "'hemisphere'"),
    _text(
        "an angle of a flat punch",
        design_text({"indenter.shape": '"flat_punch"', "indenter.cone_half_angle_deg": "60.0"}),
        "indenter.cone_half_angle_deg",
        "'cone'",
        "'flat_punch'",
    ),
    _text(
        "an edge wider than its tip",
        design_text({"indenter.shape": '"flat_punch"', "indenter.edge_radius_mm": "3.5"}),
        "indenter.edge_radius_mm",
        "3.5",
        "tip_radius_mm = 3 mm",
    ),
    _text("a profile without points", design_text(_PROFILE), "indenter.profile_mm", "missing", "profile_csv"),
    *(
        _text(what, design_text(_PROFILE | {"indenter.profile_mm": points}), *words)
        for what, points, words in (
            (
                "a profile that is no function",
                "[[0, 0], [2, 1], [1.5, 2], [3, 3]]",
                ("indenter.profile_mm.2", "1.5 mm after 2 mm", "function of radius"),
            ),
            (
                "a profile that falls",
                "[[0, 0], [2, 1], [3, 0.5]]",
                ("indenter.profile_mm.2", "0.5 mm after 1 mm", "must not fall"),
            ),
            (
                "a profile without an apex",
                "[[0.1, 0], [3, 0.5]]",
                ("indenter.profile_mm.0", "[0.1, 0]", "apex"),
            ),
            (
                "a profile that misses its shank",
                "[[0, 0], [2.5, 0.5]]",
                ("indenter.profile_mm.1", "2.5 mm", "tip_radius_mm = 3 mm"),
            ),
            (
                "a profile in micrometres",
                "[[0, 0], [3, 500]]",
                ("indenter.profile_mm.1", "500 mm", "at most 50 mm"),
            ),
            ("a profile of one point", "[[0, 0]]", ("indenter.profile_mm", "at least 2")),
        )
    ),
    _text(
        "a profile's file outside the folder",
        design_text(_PROFILE | {"indenter.profile_csv": '"../tip.csv"'}),
        "indenter.profile_csv",
        "../tip.csv",
        "leaves the design's folder",
    ),
    _text(
        "a profile's file that is a number",
        design_text(_PROFILE | {"indenter.profile_csv": "3"}),
        "indenter.profile_csv",
        "3 is refused",
    ),
    _text(
        "a profile given twice",
        design_text(
            _PROFILE | {"indenter.profile_csv": '"tip.csv"', "indenter.profile_mm": "[[0, 0], [3, 1]]"}
        ),
        "indenter.profile_csv",
        "keep one",
    ),
    *(
        BadDesign(
            id=what,
            content=design_text(_PROFILE | {"indenter.profile_csv": '"tip.csv"'}).encode(),
            beside={"tip.csv": text},
            words=words,
        )
        for what, text, words in (
            (
                "a profile's file that is no function",
                "r_mm,height_mm\n0,0\n2,1\n2,2\n3,3\n",
                ("tip.csv: row 4", "radius 2 mm after 2 mm", "function of radius"),
            ),
            ("a profile's file with a word", "0,0\n1,high\n3,2\n", ("tip.csv: row 2", "1,high")),
            (
                "a profile's file with a third number",
                "0,0,1\n3,2,1\n",
                ("tip.csv: row 1", "0,0,1", "decimal comma?"),
            ),
            ("a profile's file without points", "r,h\n", ("tip.csv", "0 points", "at least 2")),
            ("a profile's file with no number", "0,0\nnan,1\n3,2\n", ("tip.csv: row 2", "finite")),
            ("a profile's file of another radius", "0,0\n4,2\n", ("indenter.profile_mm.1", "4 mm")),
        )
    ),
)

_BOARD = (
    _field("board.emitter_pins", "[22, 23, 24, 25, 26, 27, 28, 22]", "pin 22", "2 emitters"),
    _field("board.emitter_pins", "[22, 23]", "8 emitters", "exactly 8"),
    _field("board.emitter_pins", "[0, 23, 24, 25, 26, 27, 28, 29]", "pin 0", "serial"),
    _field("board.emitter_pins", "[99, 23, 24, 25, 26, 27, 28, 29]", "pin 99"),
    _field("board.emitter_pins", "[54, 23, 24, 25, 26, 27, 28, 29]", "pin 54"),
    _field("board.receiver_channels", '["A0", "A1", "A2", "A3", "A4", "A5", "A6", "D7"]', "D7", "A15"),
    _field(
        "board.receiver_channels", '["A0", "A1", "A2", "A3", "A4", "A5", "A6", "A0"]', "A0", "2 receivers"
    ),
    _field("board.adc_prescaler", "63", "63", "one of 2, 4, 8"),
    _field("board.adc_prescaler", "0", "one of 2, 4, 8"),
    _field("board.baud", "230400", "230400", "-3.5", "250000"),
    _field("board.frame_rate_hz", "400.0", "400 Hz", "2.50 ms"),
    _layout(
        "more receivers than channels",
        _per_side("receiver", "south = 5\neast = 5\nnorth = 5\nwest = 3") + _per_side("emitter", "west = 1"),
        "board.receiver_channels",
        "18",
        "at most 16",
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
