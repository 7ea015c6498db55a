"""On the command line a bad design ends with exit code 2 and one message, and leaves no file behind."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from optopad.cli.commands import whole_command
from optopad.cli.main import BAD_INPUT, main
from optopad.cli.verb import require_folder
from optopad.design.errors import InputError
from optopad.design.files import require_suffix
from optopad.fabrication.driver.simulated.port import PtyWire
from tests.design.bad_designs import BAD_DESIGNS, FILE_NAME, BadDesign, design_text, put
from tests.design.test_bad_input import JARGON
from tests.optopad.cli.test_cli_driver import leaves
from tests.said import says

WRITERS = ("run", "build", "score", "simulate", "predict", "rays")
MAKERS = ("build", "score")
MADE = 5
"""Bad designs that are tried with the verbs that make something; `check` is asked about all."""
needs_pty = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for the bad file, while the command runs in another, empty one."""
    (tmp_path / "here").mkdir()
    (tmp_path / "files").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "files"


def everything_under(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*"))


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[str, str]:
    """Standard output and error of a command that must end with exit code 2."""
    assert main(arguments) == BAD_INPUT
    return capsys.readouterr()


def put_anew(bad: BadDesign, folder: Path) -> Path:
    """The bad file in a folder that holds nothing else."""
    for old in folder.iterdir():
        old.rmdir() if old.is_dir() else old.unlink()
    return put(bad, folder)


def test_making_something_of_a_bad_design_is_refused_on_standard_error(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for bad in BAD_DESIGNS[:: len(BAD_DESIGNS) // MADE]:
        path = put_anew(bad, folder)
        before = everything_under(folder.parent)
        for verb in MAKERS:
            out, err = refused([verb, str(path), "--out", str(folder.parent / "out")], capsys)
            assert out == "", (bad.id, verb)
            assert err.startswith("optopad: "), (bad.id, verb)
            assert [word for word in bad.words if word not in err] == [], (bad.id, verb)
            assert [word for word in JARGON if word in err] == [], (bad.id, verb)
            assert everything_under(folder.parent) == before, (bad.id, verb)


def test_a_check_of_the_good_design_ends_with_zero(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / FILE_NAME).write_text(design_text(), encoding="utf-8")
    assert main(["check", str(folder / FILE_NAME)]) == 0
    first, *lines = capsys.readouterr().out.splitlines()
    last = next(number for number, line in enumerate(lines) if line.startswith("next "))
    notes, onward = lines[:last], " ".join(lines[last:]).split()
    assert first == "design      bad: 0 errors, 0 warnings"
    assert not [line for line in notes if not line.startswith(("note ", "size ", "rate ", " "))]
    assert onward == ["next", "optopad", "score", str(folder / FILE_NAME)]


CHANGES = [
    ("cavity.clear_thickness_mm=0.5", "cavity.clear_thickness_mm: 0.5 ... least 1 mm"),
    ("cavity.clear_thickness_mm=thick", "cavity.clear_thickness_mm: 'thick'"),
    ("cavity.clear_thicknes_mm=8", "did you mean cavity.clear_thickness_mm"),
    ("cavity.clear_thickness_mm", "PATH=VALUE"),
    ("=8", "PATH=VALUE"),
    ("layout.7.count=3", "layout.7.count: no such field"),
    ("name=../../x", "no folders"),
]


@pytest.mark.parametrize(
    ("change", "words"),
    CHANGES,
)
def test_a_bad_change_is_refused_with_its_path(
    change: str, words: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / FILE_NAME).write_text(design_text(), encoding="utf-8")
    _, err = refused(["check", str(folder / FILE_NAME), "--set", change], capsys)
    assert says(err, words)


SLIPS = [
    (["score", "piacenza2017-pair", "--seed", "18446744073709551616"], "--seed"),
    (["check", "piacenza2017-pda"], "did you mean piacenza2017-pad?"),
    (
        ["score", "piacenza2017-pair", "--set", "tolerances={'emitters.hight_mm'=0.1}"],
        "emitters.height_mm",
    ),
    (["new", "x.toml", "--preset", "foo"], "'foo' is no preset. There are: piacenza2017-pad"),
    (
        ["simulate", "piacenza2017-pair", "--protocol", "piacenza2017-quick", "--press", "9,9,1"],
        "--press ... --protocol",
    ),
    (["driver", "read", "piacenza2017-pair", "--drift-time", "5"], "--drift-time: 5 needs --model"),
    (["driver", "read", "piacenza2017-pair", "--guard", "0"], "--guard: 0 needs --model"),
    (["simulate", "piacenza2017-pair", "--press", "10,10,9"], "--press: 9 mm"),
    (["simulate", "piacenza2017-pair", "--press", "10,10,-1"], "--press: depth -1 mm is refused"),
    (["rays", "piacenza2017-pair", "--press", "10,10,9"], "--press: 9 mm"),
    (["compare", "piacenza2017-pair", "../files.nc"], "files.nc: no such file"),
    (["driver", "record", "piacenza2017-pair", "--port", "nowhere", "--seconds", "0"], "--seconds: 0"),
]


@pytest.mark.parametrize(
    ("arguments", "words"),
    SLIPS,
)
def test_a_slip_on_the_command_line_is_refused_before_any_work(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    out, err = refused(arguments, capsys)
    assert out == ""
    assert says(err, words)
    assert everything_under(folder) == []


@pytest.mark.parametrize("verb", WRITERS)
def test_a_folder_that_cannot_be_made_is_refused_before_the_work(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    monkeypatch.chdir(folder)
    (folder / "taken").write_text("", encoding="utf-8")
    out, err = refused([verb, "piacenza2017-pair", "--out", "taken"], capsys)
    assert (out, "cannot be written" in err) == ("", True)
    assert "light" not in err  # no stage of the work began


@pytest.mark.parametrize(
    "arguments",
    [
        ["compare", "piacenza2017-pair", "."],
        ["train", "."],
        ["evaluate", ".", "--model", "m.optomodel"],
    ],
)
def test_a_folder_in_place_of_a_file_is_called_one(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: list[str]
) -> None:
    (folder / "x.nc").mkdir()
    monkeypatch.chdir(folder)
    given = ["x.nc" if one == "." else one for one in arguments]
    _, err = refused(given, capsys)
    assert "x.nc: a folder; " in err


def test_the_trial_of_a_folder_leaves_nothing(folder: Path) -> None:
    require_folder(folder / "new" / "deep")
    require_folder(folder)
    assert everything_under(folder) == []


OVERWRITES = [
    (
        ["driver", "fake", "pad.toml", "--out", "pad.toml", "--seconds", "0.1"],
        "end in .csv; use pad.csv",
    ),
    (["schema", "--out", "pad.toml"], "end in .json; use pad.json"),
    (["driver", "check", "pad.toml", "--out", "pad.toml"], "end in .json; use pad.json"),
    (["driver", "export", "a.optorec", "--presses", "pad.nc", "--out", "pad.nc"], "this command reads"),
]


@pytest.mark.parametrize(
    ("arguments", "words"),
    OVERWRITES,
)
def test_no_command_writes_over_what_it_reads_or_a_file_of_another_kind(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    words: str,
) -> None:
    monkeypatch.chdir(folder)
    for name in ("pad.toml", "pad.nc"):
        (folder / name).write_text(design_text(), encoding="utf-8")
    out, err = refused(arguments, capsys)
    assert out == ""
    assert words in err
    assert {file.read_text(encoding="utf-8") for file in folder.iterdir()} == {design_text()}


WRITTEN = {
    ("schema",): ".json",
    ("part", "new"): ".toml",
    ("train",): ".optomodel",
    ("driver", "read"): ".jsonl or .ndjson",
    ("driver", "record"): ".optorec or .mcap",
    ("driver", "check"): ".json",
    ("driver", "export"): ".nc or .csv or .mcap",
    ("driver", "collect"): ".nc",
    ("driver", "fake"): ".csv",
}
"""What each verb writes that writes a file; all others with --out write into a folder."""


def test_no_verb_takes_a_name_that_promises_another_content(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of every verb that has --out, before anything it is given is looked at."""
    monkeypatch.chdir(folder)
    found = set()
    for path, command in leaves(whole_command()):
        if not any("--out" in parameter.opts for parameter in command.params):
            continue
        found.add(path)
        dummies = [
            word
            for parameter in command.params
            if parameter.required and "--out" not in parameter.opts
            for word in ([parameter.opts[0], "none"] if parameter.opts[0].startswith("-") else ["none"])
        ]
        words = f"end in {WRITTEN[path]}; use x." if path in WRITTEN else "a folder is written here"
        for name in ("x.pdf", "deep/x.pkl", "x.CSV" if ".csv" not in words else "x.NPZ"):
            _, err = refused([*path, *dummies, "--out", name], capsys)
            assert err.startswith(f"optopad: --out {name}: "), path
            assert words.replace("use x", "use deep/x" if "/" in name else "use x") in err, path
    assert set(WRITTEN) < found
    assert everything_under(folder) == []
    with pytest.raises(InputError, match=r"x\.json.*x\.toml"):
        require_suffix(Path("x.json"), (".toml",))
    refused(["new", "x.json"], capsys)


@needs_pty
@pytest.mark.parametrize("option", ["--link", "--stage-link"])
def test_a_living_board_s_name_is_refused_before_the_work(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], option: str
) -> None:
    monkeypatch.chdir(folder)
    other = PtyWire(Path("taken"))
    out, err = refused(["driver", "fake", "piacenza2017-pair", option, "taken", "--seconds", "0.1"], capsys)
    assert out == ""
    assert err.startswith(f"optopad: {option} taken: leads to ")  # no stage of the work began
    assert Path("taken").is_symlink()
    other.close()
    assert everything_under(folder) == []


@needs_pty
@pytest.mark.parametrize(
    ("stage_link", "words"),
    [
        ("pad", "is also the board's --link"),
        ("nowhere/stage", "--stage-link nowhere/stage: cannot be made"),
    ],
)
def test_a_printer_s_name_that_is_refused_leaves_no_link_of_the_board(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    stage_link: str,
    words: str,
) -> None:
    monkeypatch.chdir(folder)
    names = ["--link", "pad", "--stage-link", stage_link]
    _, err = refused(["driver", "fake", "piacenza2017-pair", *names, "--seconds", "0.1"], capsys)
    assert words in err
    assert everything_under(folder) == []


def test_a_folder_without_the_right_to_look_into_it_is_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def denied(path: Path, **_: object) -> bool:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "exists", denied)
    _, said = refused(["check", "there/a.toml"], capsys)
    assert "there/a.toml: Permission" in said


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs Linux's /proc")
@pytest.mark.parametrize("verb", WRITERS)
def test_a_folder_that_only_seems_writable_is_refused_before_the_work(
    folder: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    out, err = refused([verb, "piacenza2017-pair", "--out", "/proc/nope"], capsys)
    assert out == ""
    assert err.startswith(
        "optopad: --out /proc/nope: cannot be written: it does not exist and cannot be made: /proc: "
    )


def test_checking_a_bad_design_shows_its_fault_and_writes_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for bad in BAD_DESIGNS:
        path = put_anew(bad, folder)
        before = everything_under(folder.parent)
        out, err = refused(["check", str(path)], capsys)
        said = " ".join((out + err).split())
        assert [word for word in bad.words if word not in said] == [], bad.id
        assert [word for word in JARGON if word in said] == [], bad.id
        assert everything_under(folder.parent) == before, bad.id
