"""Verbs that write and validate designs: new, check, schema, migrate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from design.preset import PRESETS
from optopad.cli import options
from optopad.cli.output import print_json, say, tell
from optopad.work.designs import read_design


def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Design file to write.")],
    preset: Annotated[
        str,
        typer.Option(help=f"{', '.join(PRESETS[:-1])} or {PRESETS[-1]}."),
    ] = "piacenza2017-pad",
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    as_json: options.Json = False,
) -> None:
    """Write a commented design file to start from."""
    import re
    import tomllib

    from design.errors import InputError
    from design.fields.base import NAME_PATTERN
    from design.io import write_text_atomically
    from design.preset import new_text
    from design.spec import SensorDesign
    from design.whole_file import require_suffix

    require_suffix(file, (".toml",))
    if not re.fullmatch(NAME_PATTERN, file.stem):
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem).strip("._-")[:63] or "my-pad"
        raise InputError(
            f"{file}: a design is named after its file, in plain letters, digits, dots, dashes and underscores, "
            f"63 at most; say {file.with_name(plain + '.toml')}"
        )
    if file.exists() and not force:
        raise InputError(f"{file}: exists already; choose another name, or --force to replace it")
    text = new_text(file.stem, preset)
    design = SensorDesign.from_document(tomllib.loads(text), where=str(file))
    write_text_atomically(file, text)
    if as_json:
        print_json({"file": str(file), "preset": preset, "digest": design.digest})
    else:
        say(f"{file} written from {preset}. Next: optopad check {file}, then optopad run {file}")


def check(
    design: options.Design,
    set_: options.Set = None,
    details: options.Details = False,
    as_json: options.Json = False,
) -> None:
    """Does it fit and can it work? Lists every finding; exit 2 when one is an error."""
    from dataclasses import asdict

    from design.rules.check import check as findings_of
    from design.rules.check import notes
    from optopad.screen.numbers import counted
    from optopad.screen.verdict import as_typed, findings_screen

    read = read_design(design, set_)
    findings = findings_of(read)
    errors = [finding for finding in findings if finding.severity == "error"]
    total = f"{read.name}: {counted(len(errors), 'error')}, {counted(len(findings) - len(errors), 'warning')}"
    findings = findings if errors else (*findings, *notes(read))
    tell(
        as_json,
        lambda: {"name": read.name, "digest": read.digest, "findings": [asdict(f) for f in findings]},
        lambda: (
            [*map(str, findings), total]
            if details
            else findings_screen(read.name, findings, command=f"score {as_typed(design, set_)}")
        ),
    )
    if errors:
        raise typer.Exit(2)


def schema(
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="File to write (.json); default: standard output.",
            callback=options.file_name(".json"),
        ),
    ] = None,
) -> None:
    """JSON Schema of a design file, for an editor's completion and checks."""
    import json

    from design.io import file_schema, write_text_atomically

    text = json.dumps(file_schema(), indent=2) + "\n"
    if out is None:
        typer.echo(text, nl=False)
    else:
        write_text_atomically(out, text)
        say(f'{out} written. In a design file: "#:schema {out}" as the first line')


def migrate(
    file: Annotated[Path, typer.Argument(metavar="DESIGN", help="Design file of an older schema version.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="File to write (.toml); default: beside it, -migrated.",
            callback=options.file_name(".toml"),
        ),
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Lift a design file of an older schema version to the present one; newer ones are refused."""
    import tomlkit

    from design.io import check_version, read_toml, without_empty, write_text_atomically
    from design.migrate import migrated
    from design.spec import SCHEMA_VERSION

    document = read_toml(file)
    version = document.get("schema_version")
    if version == SCHEMA_VERSION:
        read_design(str(file), None)
        message, target = f"{file}: already schema version {SCHEMA_VERSION}; nothing to do", file
    else:
        lifted = migrated(document)
        check_version(lifted, file)
        target = out or file.with_name(f"{file.stem}-migrated{file.suffix}")
        options.checked_out(target, file)
        write_text_atomically(target, tomlkit.dumps(without_empty(lifted)))
        message = f"{target} written: schema version {version} lifted to {SCHEMA_VERSION}"
    tell(as_json, lambda: {"file": str(target), "from": version, "to": SCHEMA_VERSION}, lambda: [message])
