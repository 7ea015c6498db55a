"""The file under edit: what is written is the design, and nothing of the user's text is lost."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import tomlkit
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from optopad.design.errors import DesignError, InputError, OptopadError, OutputError
from optopad.design.io import load_design, save_design
from optopad.design.preset import FLAT_PRESETS, PRESETS, SHAPED_PRESETS, WALL_PRESETS, preset, preset_text
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.studio.design_file import DesignFile, comments_of
from optopad.studio.editable_fields import changes_of, editable_fields_of
from optopad.studio.moves import moved
from tests.design.parts.own_parts import own_part

PAD, PAIR = "piacenza2017-pad", "piacenza2017-pair"
DISC, CROWNED, DOME, STADIUM = SHAPED_PRESETS
RECTANGLES = (*FLAT_PRESETS, CROWNED, "gripper-teensy")
IN_TURN = [
    name if name in (PAD, DOME) else pytest.param(name, marks=pytest.mark.slow) for name in WALL_PRESETS
]
"""A flat and a crowned one; the others in every CI run."""
OWN_PARTS = tomlkit.dumps({"parts": {"mine": own_part("receiver")}})
FIELDS: dict[str, dict[str, Any]] = {
    "thickness": {"cavity.clear_thickness_mm": 9.25},
    "heights": {"emitters.height_mm": 4.2, "receivers.height_mm": 4.4},
    "optional set": {"elastomer.youngs_modulus_mpa": 1.5},
    "pitch": {"layout.0.pitch_mm": 3.3},
    "table that is not there": {"tolerances": {"emitters.height_mm": 0.1}},
    "table in a table": {"elastomer.viscoelastic": {"relaxed_share": 0.2, "time_constant_s": 3.0}},
    "text": {"description": 'a "new" one, with a # in it'},
    "list": {"measured": ["cavity.clear_thickness_mm"]},
    "many": {"cavity.length_mm": 34.0, "mold.outer_length_mm": 47.0, "noise.read_noise_counts": 1e-05},
}
OF_DISCS: dict[str, dict[str, Any]] = {
    "pitch": {"layout.0.first_angle_deg": 7.5},
    "many": {"cavity.diameter_mm": 34.0, "mold.outer_diameter_mm": 47.0, "layout.0.count": 5},
}

OF_STADIUMS: dict[str, dict[str, Any]] = {
    "pitch": {"layout.2.shift_mm": -2.0},
    "many": {"cavity.length_mm": 26.0, "mold.outer_length_mm": 36.0, "noise.read_noise_counts": 1e-05},
}


OF_RINGS: dict[str, dict[str, Any]] = OF_DISCS | {
    "many": {"cavity.diameter_mm": 140.0, "mold.outer_diameter_mm": 166.0, "layout.0.receivers": 11}
}


def copy_of(name: str, folder: Path, text: str | None = None) -> Path:
    file = folder / "pad.toml"
    file.write_text(preset_text(name) if text is None else text, encoding="utf-8", newline="")
    return file


def dragged(design: SensorDesign, number: int = 0, by_mm: float = 0.5) -> SensorDesign:
    """A design with one part dragged along its wall."""
    part = cavity_of(design).parts[number]
    if part.angle_deg is not None:
        return design.with_(**moved(design, part.name, angle_deg=part.angle_deg + 4.0 * by_mm))
    return design.with_(**moved(design, part.name, along_mm=part.along_mm + by_mm))


def require_kept(before: str, after: str) -> None:
    """Every comment is still there as often, and what was a line of its own is one."""
    counts = Counter(comments_of(before))
    assert {
        comment: after.count(comment) for comment in counts if after.count(comment) < counts[comment]
    } == {}
    lines = [line for line in before.splitlines() if line.lstrip().startswith("#")]
    assert [line for line in lines if line not in after.splitlines()] == []


def changed_lines(before: str, after: str) -> tuple[list[str], list[str]]:
    """Lines that are gone, and new ones."""
    was, now = Counter(before.splitlines(keepends=True)), Counter(after.splitlines(keepends=True))
    return sorted((was - now).elements()), sorted((now - was).elements())


@pytest.mark.parametrize("name", IN_TURN)
@pytest.mark.parametrize("kind", FIELDS)
def test_a_saved_edit_is_the_design_and_every_other_line_is_as_it_was(
    name: str, kind: str, tmp_path: Path
) -> None:
    of_others = {STADIUM: OF_STADIUMS, "roboy-lightskin": OF_RINGS}.get(name, OF_DISCS)
    changes = FIELDS[kind] if name in RECTANGLES else (FIELDS | of_others)[kind]
    path = copy_of(name, tmp_path)
    file = DesignFile(str(path))
    design = file.saved.with_(**changes)
    assert file.save(design) == path
    text = path.read_text(encoding="utf-8")
    assert load_design(path).digest == design.digest
    require_kept(preset_text(name), text)
    gone, _ = changed_lines(preset_text(name), text)
    keys = {path.rpartition(".")[2] for path in changes}
    assert {line.split(" = ")[0] for line in gone} <= keys
    assert len(gone) <= len(changes)
    assert os.listdir(tmp_path) == ["pad.toml"]


@pytest.mark.parametrize("name", RECTANGLES)
@pytest.mark.parametrize("number", [0, -1])
def test_a_part_dragged_out_of_its_pattern_keeps_every_comment_and_every_other_line(
    name: str, number: int, tmp_path: Path
) -> None:
    path = copy_of(name, tmp_path)
    file = DesignFile(str(path))
    design = dragged(file.saved, number)
    file.save(design)
    text = path.read_text(encoding="utf-8")
    assert load_design(path).digest == design.digest
    require_kept(preset_text(name), text)
    gone, new = changed_lines(preset_text(name), text)
    pattern = preset(name).layout[0].model_dump(exclude_none=True)
    assert {line.split(" = ")[0] for line in gone} <= set(pattern)
    kinds = {line.split(" = ")[0] for line in new if not line.startswith("#")}
    assert kinds == {"[[layout]]\n", "\n", "pattern", "kind", "wall", "along_mm"}
    assert "\n\n\n" not in text
    again = dragged(design, number)
    file.save(again)
    gone, new = changed_lines(text, path.read_text(encoding="utf-8"))
    assert [len(gone), len(new)] == [1, 1]
    assert gone[0].startswith("along_mm = ")


def test_ends_of_lines_and_a_byte_order_mark_stay(tmp_path: Path) -> None:
    text = "\ufeff" + preset_text(PAD).replace("\n", "\r\n")
    path = copy_of(PAD, tmp_path, text)
    file = DesignFile(str(path))
    design = dragged(file.saved.with_(**{"elastomer.youngs_modulus_mpa": 1.5}))
    file.save(design)
    content = path.read_bytes()
    assert load_design(path).digest == design.digest
    assert content.startswith(b"\xef\xbb\xbf# The complete pad")
    assert content.count(b"\n") == content.count(b"\r\n") > text.count("\n")
    gone, _ = changed_lines(text, content.decode("utf-8"))
    assert [line.split(" = ")[0] for line in gone] == ["parts_per_side", "pattern"]


RING = '[[layout]]\npattern = "alternating_ring"\nparts_per_side = 4 '
IN_BRACKETS = '\nlayout = [ # around\n  { pattern = "alternating_ring", parts_per_side = 4 }, # all\n]\n'
INLINE = "\ncavity = { length_mm = 32.0, width_mm = 32.0, clear_thickness_mm = 8.0 } # inner\n"
LATE = "[elastomer.viscoelastic] # late\nrelaxed_share = 0.2\ntime_constant_s = 1.0 # s\n\n[indenter]\n"
STYLES: dict[str, tuple[tuple[str, str], ...]] = {
    "dotted": (
        ("[cavity]\nlength_mm", "cavity.length_mm"),
        ("\nwidth_mm", "\ncavity.width_mm"),
        ("\nclear_", "\ncavity.clear_"),
        ("\nblack_", "\ncavity.black_"),
    ),
    "inline": (
        ("\nschema_version", f"{INLINE}schema_version"),
        ("[cavity]\nlength_mm", "#@\n# length_mm"),
        ("\nwidth_mm", "\n# width_mm"),
        ("\nclear_", "\n# clear_"),
        ("\nblack_", "\n# black_"),
    ),
    "layout in brackets": ((RING, "#@ "), ("\nschema_version", f"{IN_BRACKETS}schema_version")),
    "parts in lines": (("_side = 4 ", "_side = [ # by wall\n  4, # south\n  4, 4,\n  4,\n] "),),
    "quoted keys": (("\nclear_thickness_mm =", '\n"clear_thickness_mm" ='),),
    "out of order": (("[indenter]\n", LATE),),
    "few lines": (("\n[board]\n", ""), ("\n[noise] ", "[noise] ")),
    "no blank lines": (("\n\n", "\n"),) * 12,
}  # fmt: skip


def written(style: str) -> str:
    """The pad's file, otherwise written."""
    text = preset_text(PAD)
    for old, new in STYLES[style]:
        assert old in text
        text = text.replace(old, new, 1)
    if style == "few lines":
        text = text[: text.index("kind = ")].rstrip("\n")
    return text


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize(
    "edits",
    [
        ["cavity.clear_thickness_mm=9"],
        ["drag"],
        ["operating.max_depth_mm=4", "elastomer.youngs_modulus_mpa=1.5", "drag", "drag"],
        ["layout.0.pitch_mm=7.5", "drag", "start"],
    ],
    ids=["value", "drag", "many", "and back"],
)
def test_every_way_to_write_a_design_is_edited_and_keeps_its_comments(
    style: str, edits: list[str], tmp_path: Path
) -> None:
    text = written(style)
    path = copy_of(PAD, tmp_path, text)
    file = DesignFile(str(path))
    start = design = file.saved
    for edit in edits:
        name, _, value = edit.partition("=")
        if name == "drag":
            design = dragged(design)
        else:
            design = start if name == "start" else design.with_(**{name: float(value)})
        file.save(design)
        assert load_design(path).digest == design.digest
    after = path.read_text(encoding="utf-8")
    assert [comment for comment in comments_of(text) if comment not in after] == []


def test_own_parts_are_kept_beside_the_file(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(OWN_PARTS, encoding="utf-8")
    text = preset_text(PAD).replace(
        "schema_version", 'catalog_files = ["own.toml"]  # mine\nschema_version', 1
    )
    path = copy_of(PAD, tmp_path, text)
    file = DesignFile(str(path))
    design = file.saved.with_(**{"cavity.clear_thickness_mm": 9.0, "receivers.part": "mine"})
    file.save(design)
    assert 'catalog_files = ["own.toml"]  # mine\n' in path.read_text(encoding="utf-8")
    assert load_design(path).digest == design.digest
    file.save(design, "new.toml")
    assert load_design(tmp_path / "new.toml").digest == design.digest
    assert sorted(os.listdir(tmp_path)) == ["new.toml", "own.toml", "pad.toml"]


def test_a_tip_s_file_of_points_is_kept_beside_the_file(tmp_path: Path) -> None:
    rows = [(r / 4, 3.0 - (9.0 - (r / 4) ** 2) ** 0.5) for r in range(13)]
    (tmp_path / "tip.csv").write_text("".join(f"{r},{z:.6f}\n" for r, z in rows), encoding="utf-8")
    text = preset_text(PAD).replace(
        "[indenter]\n", '[indenter]\nshape = "profile"\nprofile_csv = "tip.csv" # lathe\n'
    )
    file = DesignFile(str(copy_of(PAD, tmp_path, text)))
    design = file.saved.with_(**FIELDS["heights"])
    file.save(design)
    assert 'profile_csv = "tip.csv" # lathe\n' in (tmp_path / "pad.toml").read_text(encoding="utf-8")
    assert load_design(tmp_path / "pad.toml").digest == design.digest
    (tmp_path / "tip.csv").write_text("0,0\n3,2\n", encoding="utf-8")
    file.save(design)  # with the points that it has
    assert load_design(tmp_path / "pad.toml").digest == design.digest
    require_kept(text, (tmp_path / "pad.toml").read_text(encoding="utf-8"))


def test_another_file_is_never_overwritten(tmp_path: Path) -> None:
    path, other = copy_of(PAD, tmp_path), tmp_path / "other.toml"
    other.write_text("mine\n", encoding="utf-8")
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "nowhere.toml").symlink_to(tmp_path / "gone" / "pad.toml")
    file = DesignFile(str(path))
    for name in ("other.toml", "folder.toml", "nowhere.toml"):
        with pytest.raises(InputError, match=rf".*{name}"):
            file.save(file.saved, name)
    assert other.read_text(encoding="utf-8") == "mine\n"
    assert file.path == path
    assert file.save(file.saved, " pad.toml ") == path
    (tmp_path / "link.toml").symlink_to(path)
    assert file.save(file.saved, "link.toml").samefile(path)


DEVICES = ("CON", "con.toml", "Nul.toml", "aux .toml", "prn.x.toml", "COM1.toml", "lpt9.toml", "CONIN$.toml")
PATHS = ("../out.toml", "/out.toml", "in/out.toml", "..\\out.toml", "C:\\out.toml", "c:out.toml", "pad.toml/")


@pytest.mark.parametrize(
    ("name", "error", "words"),
    [
        *[(name, InputError, "is refused: .* give a name alone.* saved in ") for name in DEVICES + PATHS],
        *[(f"a{sign}b.toml", InputError, "it is not a plain file name; give") for sign in '<>:"|?*\0\n\x7f'],
        *[(name, InputError, "ends in .toml") for name in ("pad", "pad.json", ".toml")],
        *[(name, InputError, "drops a dot or a blank at the end") for name in (".", "..", "pad.toml.")],
        ("x" * 300 + ".toml", OutputError, "File name"),
    ],
)
@pytest.mark.parametrize("where", ["file", "preset"])
def test_a_save_stays_in_the_folder_and_a_name_that_cannot_be_is_refused(
    where: str,
    name: str,
    error: type[OptopadError],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = tmp_path / "mine"
    (folder / "in").mkdir(parents=True)
    path = copy_of(PAD, folder)
    if where == "preset":
        monkeypatch.chdir(folder)
    file = DesignFile(str(path) if where == "file" else PAD)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(error, match=words):
        file.save(file.saved, name)
    assert sorted(tmp_path.rglob("*")) == before
    assert file.path == (path if where == "file" else None)


def test_a_folder_that_cannot_be_written_is_named_and_the_file_is_intact(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = copy_of(PAD, tmp_path)
    file = DesignFile(str(path))
    design = file.saved.with_(**FIELDS["heights"])

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    for module, name in ((tempfile, "mkstemp"), (os, "replace")):
        with monkeypatch.context() as patch:
            patch.setattr(module, name, refuse)
            with pytest.raises(OutputError, match=r"pad\.toml.*Permission"):
                file.save(design)
        assert path.read_text(encoding="utf-8") == preset_text(PAD)
        assert os.listdir(tmp_path) == ["pad.toml"]
    assert file.saved.digest == preset(PAD).digest


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_write_protected_file_is_refused(tmp_path: Path) -> None:
    path = copy_of(PAD, tmp_path)
    path.chmod(0o444)
    file = DesignFile(str(path))
    with pytest.raises(OutputError, match="is write-protected; choose another name"):
        file.save(file.saved)


def test_a_file_keeps_its_rights_and_a_link_stays_a_link(tmp_path: Path) -> None:
    path = copy_of(PAD, tmp_path)
    path.chmod(0o600)
    link = tmp_path / "link.toml"
    link.symlink_to(path)
    file = DesignFile(str(link))
    file.save(file.saved.with_(**FIELDS["heights"]))
    assert link.is_symlink()
    assert load_design(path).receivers.height_mm == 4.4
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("where", ["preset", "bundle"])
def test_a_preset_or_bundle_is_saved_under_a_new_name_only(
    where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    bundle = tmp_path / "piacenza2017-pad-12345678"
    bundle.mkdir()
    save_design(preset(PAD), bundle / "design.toml")
    (bundle / "manifest.json").write_text("{}", encoding="utf-8")
    before = (bundle / "design.toml").read_bytes()
    file = DesignFile(PAD if where == "preset" else str(bundle))
    assert file.path is None
    assert file.default_name == "piacenza2017-pad.toml"
    for target in (None, "", "  "):
        with pytest.raises(InputError, match=r"my-pad\.toml"):
            file.save(file.saved, target)
    new = Path("mine.toml")
    assert file.save(file.saved, "mine.toml") == new
    assert [str(file.path), file.default_name] == ["mine.toml", "mine.toml"]
    text = new.read_text(encoding="utf-8")
    assert text == preset_text(PAD) if where == "preset" else "digest" not in text
    assert load_design(new).digest == preset(PAD).digest
    file.save(file.saved.with_(**FIELDS["heights"]))
    assert load_design(new).receivers.height_mm == 4.4
    assert (bundle / "design.toml").read_bytes() == before


def test_saved_under_a_new_name_the_old_file_is_left_and_the_new_one_is_edited(tmp_path: Path) -> None:
    path = copy_of(PAD, tmp_path)
    file = DesignFile(str(path))
    design = file.saved.with_(**FIELDS["thickness"])
    file.save(design, "new.toml")
    assert path.read_text(encoding="utf-8") == preset_text(PAD)
    path.unlink()
    assert file.changed_outside() is None
    assert file.path == tmp_path / "new.toml"


def test_what_is_no_design_is_refused_when_it_is_opened(tmp_path: Path) -> None:
    with pytest.raises(DesignError, match="no such file"):
        DesignFile(str(tmp_path / "gone.toml"))
    with pytest.raises(DesignError, match="not valid TOML"):
        DesignFile(str(copy_of(PAD, tmp_path, "[cavity")))
    with pytest.raises(DesignError, match="folder; needs"):
        DesignFile(str(tmp_path))


@st.composite
def edited(draw: st.DrawFn, design: SensorDesign) -> SensorDesign:
    """A design after one edit that the studio offers; as it was where the fields refuse it."""
    part = draw(st.none() | st.sampled_from(cavity_of(design).parts))
    if part is not None and part.angle_deg is not None:
        changes = moved(
            design,
            part.name,
            angle_deg=draw(st.none() | st.floats(-400.0, 400.0)),
            height_mm=draw(st.none() | st.floats(0.1, 9.0)),
            with_row=draw(st.booleans()),
        )
    elif part is not None:
        changes = moved(
            design,
            part.name,
            along_mm=draw(st.none() | st.floats(0.1, 60.0)),
            height_mm=draw(st.none() | st.floats(0.1, 9.0)),
            with_row=draw(st.booleans()),
        ) if draw(st.booleans()) else moved(design, part.name, along_mm=part.along_mm + 0.5)  # fmt: skip
    else:
        field = draw(st.sampled_from(editable_fields_of(design)))
        value: Any
        if field.kind == "choice":
            value = draw(st.sampled_from(field.choices))
        elif field.kind == "whole":
            value = draw(st.integers(int(field.low or 0), int(field.high or 0)))
        else:
            value = draw(st.floats(field.low or 0.0, 100.0 if field.high is None else field.high))
        changes = changes_of(design, field.path, value)
    try:
        return design.with_(**changes)
    except DesignError:
        return design


@given(st.data())
@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
def test_edits_saved_on_the_way_load_as_the_design_on_the_table(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(WALL_PRESETS))
    with tempfile.TemporaryDirectory() as folder:
        path = copy_of(name, Path(folder))
        file = DesignFile(str(path))
        design = file.saved
        for _ in range(data.draw(st.integers(1, 4))):
            design = data.draw(edited(design))
            if data.draw(st.booleans()):
                file.save(design)
        file.save(design)
        assert load_design(path).digest == design.digest
        after = path.read_text(encoding="utf-8")
        assert [one for one in comments_of(preset_text(name)) if one not in after] == []
        shutil.copy(path, path.with_name("copy.toml"))
        assert DesignFile(str(path.with_name("copy.toml"))).saved.digest == design.digest


def test_a_file_that_appears_meanwhile_is_not_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = DesignFile(PAD)
    target = copy_of(PAIR, tmp_path)
    with pytest.raises(InputError, match="exists and is another file"):
        file.save(file.saved, target.name)
    assert target.read_text(encoding="utf-8") == preset_text(PAIR)


def test_a_part_that_leaves_its_pattern_leaves_the_text_around_the_layout_in_place(tmp_path: Path) -> None:
    text = preset_text(PAD)
    start, end = text.index("[[layout]]"), text.index("[indenter]")
    told = "# Walls first, corners free.\n"
    text = text[:end] + "# What presses it:\n" + text[end:]
    text = text[:start] + told + text[start:]
    path = copy_of(PAD, tmp_path, text)
    file = DesignFile(str(path))
    file.save(dragged(file.saved))
    after = path.read_text(encoding="utf-8")
    assert after.startswith(text[: start + len(told)])
    assert after.endswith("\n# What presses it:\n" + text[text.index("[indenter]") :])
    first = after[start + len(told) :].splitlines()
    assert first[:3] == [
        "[[layout]]",
        "# parts_per_side = 4          # two emitters and two receivers on each wall, in turn",
        'pattern = "single"',
    ]


def test_other_patterns_of_a_layout_keep_their_text_when_one_is_taken_apart(tmp_path: Path) -> None:
    row = '[[layout]]  # row of {0}\npattern = "per_side"\nkind = "{0}"\n{1} = 3  # on the {1}\n\n'
    text = preset_text(PAD)
    start, end = text.index("[[layout]]"), text.index("[indenter]")
    text = text[:start] + row.format("emitter", "west") + row.format("receiver", "east") + text[end:]
    path = copy_of(PAD, tmp_path, text)
    file = DesignFile(str(path))
    design = dragged(file.saved, 1)
    file.save(design)
    after = path.read_text(encoding="utf-8")
    assert load_design(path).digest == design.digest
    assert row.format("receiver", "east") in after
    assert after.index("# row of emitter\n") < after.index("# west = 3  # on the west\n")
    assert after.count('pattern = "single"') == 3
    require_kept(text, after)
    changed = design.with_(**{"layout.3.east": 4, "layout.3.shift_mm": 0.5})
    file.save(changed)
    assert "east = 4  # on the east\nshift_mm = 0.5\n\n[indenter]" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", PRESETS)
def test_an_optional_field_set_and_unset_leaves_the_file_as_it_was(name: str, tmp_path: Path) -> None:
    path = copy_of(name, tmp_path)
    file = DesignFile(str(path))
    design = file.saved
    for key, value in (
        ("elastomer.youngs_modulus_mpa", 2.0),
        ("elastomer.viscoelastic", {"relaxed_share": 0.1, "time_constant_s": 1.0}),
    ):
        file.save(design.with_(**{key: value}))
        assert path.read_text(encoding="utf-8") != preset_text(name)
        file.save(design)
        assert path.read_text(encoding="utf-8") == preset_text(name)


@pytest.mark.parametrize("name", WALL_PRESETS)
def test_saving_twice_is_saving_once(name: str, tmp_path: Path) -> None:
    path = copy_of(name, tmp_path)
    file = DesignFile(str(path))
    file.save(file.saved)
    assert path.read_text(encoding="utf-8") == preset_text(name)
    for design in (dragged(file.saved), file.saved.with_(**FIELDS["heights"])):
        file.save(design)
        once = path.read_bytes()
        file.save(design)
        assert path.read_bytes() == once
    DesignFile(str(path)).save(design)
    assert path.read_bytes() == once


def test_a_design_whose_own_parts_were_changed_since_is_saved_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(OWN_PARTS, encoding="utf-8")
    path = copy_of(PAD, tmp_path, 'catalog_files = ["own.toml"]\n' + preset_text(PAD))
    before = DesignFile(str(path)).saved
    (tmp_path / "own.toml").write_text("", encoding="utf-8")
    file = DesignFile(str(path))
    assert file.saved.digest != before.digest
    file.save(before)
    assert load_design(path).digest == before.digest
    require_kept(preset_text(PAD), path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", [DISC, DOME])
@pytest.mark.parametrize("number", [0, -1])
def test_a_part_turned_out_of_its_ring_keeps_every_comment_and_every_other_line(
    name: str, number: int, tmp_path: Path
) -> None:
    path = copy_of(name, tmp_path)
    file = DesignFile(str(path))
    design = dragged(file.saved, number)
    file.save(design)
    text = path.read_text(encoding="utf-8")
    assert load_design(path).digest == design.digest
    require_kept(preset_text(name), text)
    gone, new = changed_lines(preset_text(name), text)
    assert {line.split(" = ")[0] for line in gone} == {"pattern", "count"} | (
        {"first_angle_deg"} if name == DISC else set()
    )
    kinds = {line.split(" = ")[0] for line in new if not line.startswith("#")}
    assert kinds == {"[[layout]]\n", "\n", "pattern", "kind", "angles_deg"}
    file.save(dragged(design, number))
    gone, new = changed_lines(text, path.read_text(encoding="utf-8"))
    assert [line.split(" = ")[0] for line in (*gone, *new)] == ["angles_deg", "angles_deg"]


@pytest.mark.parametrize("name", SHAPED_PRESETS)
def test_every_field_of_a_disc_or_crown_is_saved_with_its_comments(name: str, tmp_path: Path) -> None:
    path = copy_of(name, tmp_path)
    file = DesignFile(str(path))
    for field in editable_fields_of(preset(name)):
        value = field.choices[-1] if isinstance(field.value, str) else field.value + field.step
        design = preset(name).with_(**changes_of(preset(name), field.path, value))
        file.save(design)
        assert load_design(path).digest == design.digest
        require_kept(preset_text(name), path.read_text(encoding="utf-8"))
