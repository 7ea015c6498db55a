"""Figures of contact and light, each read from a stored result."""

from __future__ import annotations

import re
from collections.abc import Iterator

from tests.validation.stored import ROOT, Figure, column, made, number, table, tables

MEAN = "mean % of the pair's signal"
"""Heading of a column."""


def contact() -> Iterator[Figure]:
    """Presses against finite elements."""
    page = "docs/validation/contact.md"
    rows = table(page, "force %", "surface rms µm", "the oracle's mm")
    deep = column(rows, "force %", lambda row: number(row["depth mm"]) >= 0.5)
    radius = [abs(number(row["contact radius mm"]) - number(row["the oracle's mm"])) for row in rows]
    yield made(
        page, "contact.shallow", "error of force at 0.2 mm, largest", max(column(rows, "force %")), ".1f", "%"
    )
    yield made(page, "contact.least", "error of force from 0.5 mm on, least", min(deep), ".1f", "%")
    yield made(page, "contact.most", "error of force from 0.5 mm on, largest", max(deep), ".1f", "%")
    yield made(
        page,
        "contact.rms",
        "error of the surface, rms, largest",
        max(column(rows, "surface rms µm")),
        ".1f",
        "µm",
    )
    yield made(
        page,
        "contact.near",
        "error of the surface to 9 mm from the axis, largest",
        max(column(rows, "largest µm")),
        ".0f",
        "µm",
    )
    yield made(
        page,
        "contact.far",
        "error of the surface to the wall, largest",
        max(column(rows, "largest to the wall µm")),
        ".0f",
        "µm",
    )
    yield made(page, "contact.radius", "error of the contact radius, largest", max(radius), ".3f", "mm")

    page = "docs/validation/contact-interpolation.md"
    flat = table(page, "layer / R", "contact edge um")
    for name, kept in (
        ("flat", [r for r in flat if "crown" not in r]),
        ("crown", [r for r in flat if "crown" in r]),
    ):
        force, rms = (column(kept, head) for head in ("force %", "surface rms um"))
        yield made(
            page,
            f"between.{name}.force",
            f"interpolated force, {name}, largest error",
            max(map(abs, force)),
            ".2f",
            "%",
        )
        yield made(
            page,
            f"between.{name}.rms",
            f"interpolated surface, {name}, largest error rms",
            max(rms),
            ".1f",
            "µm",
        )
        if name == "crown":
            edge = max(map(abs, column(kept, "contact edge um")))
            yield made(
                page,
                "between.crown.edge",
                "interpolated edge of contact, crown, largest error",
                edge,
                ".0f",
                "µm",
            )

    page = "tests/validation/contact/crown/crown_table.md"
    rows = table(page, "crown mm", "force %")
    wide = [row for row in rows if number(row["crown mm"]) >= 14]
    deep = column(wide, "force %", lambda row: number(row["depth mm"]) >= 0.5)
    thin = [row for row in rows if number(row["crown mm"]) == 12 and number(row["depth mm"]) == 3]
    yield made(
        page,
        "crown.force",
        "error of force at the apex from 0.5 mm on, crowns of 14 to 60 mm, largest",
        max(deep),
        ".1f",
        "%",
    )
    yield made(
        page,
        "crown.rms",
        "error of the surface at the apex, crowns of 14 to 60 mm, rms, largest",
        max(column(wide, "surface rms µm")),
        ".1f",
        "µm",
    )
    yield made(
        page,
        "crown.thin.force",
        "error of force at the apex of a crown of 12 mm, 3 mm deep",
        number(thin[0]["force %"]),
        "+.1f",
        "%",
    )
    yield made(
        page,
        "crown.thin.rms",
        "error of the surface there, rms",
        number(thin[0]["surface rms µm"]),
        ".0f",
        "µm",
    )

    page = "tests/validation/contact/crown/offset_table.md"
    rows = table(page, "press", "thickness", "force %")
    beside = [
        r
        for r in rows
        if r["thickness"] == "along the normal" or (r["press"], r["thickness"]) == ("flat", "local")
    ]
    small = column(
        beside, "surface to 3 radii: rms, largest µm", lambda r: r["press"] != "dome" and r["depth mm"] == "2"
    )
    steep = column(
        beside, "surface to 3 radii: rms, largest µm", lambda r: r["press"] == "dome" and r["depth mm"] == "3"
    )
    yield made(
        page,
        "beside.force",
        "error of force away from the apex, largest",
        max(map(abs, column(beside, "force %"))),
        ".1f",
        "%",
    )
    yield made(
        page,
        "beside.least",
        "error of the surface around the tip, 2 mm deep, pads of 22 mm, rms, least",
        min(small),
        ".0f",
        "µm",
    )
    yield made(page, "beside.most", "the same, largest", max(small), ".0f", "µm")
    yield made(page, "beside.steep", "the same on the steep dome, 3 mm deep", max(steep), ".0f", "µm")

    page = "docs/validation/contact-crowns.md"
    rows = table(page, "pressed", "surface to 3 tip radii: rms, largest µm")
    surface = "surface to 3 tip radii: rms, largest µm"
    for name, press in (("middle", "the middle"), ("round", "the centre of a half round")):
        mine = [row for row in rows if row["pressed"] == press]
        worst = max(column(mine, "force"), key=abs)
        sign = ".1f" if name == "middle" else "+.1f"
        yield made(
            page, f"stadium.{name}.force", f"error of force in a stadium, {press}, largest", worst, sign, "%"
        )
        yield made(
            page,
            f"stadium.{name}.rms",
            "error of the surface there, 2 mm deep, rms",
            max(column(mine, surface)),
            ".0f",
            "µm",
        )


def walls() -> Iterator[Figure]:
    """Presses near walls, against finite elements in three dimensions."""
    page = "docs/validation/walls.md"
    rows = table(page, "press", "light: rms, largest %")
    light = "light: rms, largest %"
    pads = [row for row in rows if row["press"] != "small pad"]
    small = [row for row in rows if row["press"] == "small pad"]
    shallow, deep = (
        [r for r in pads if (number(r["depth mm"]) <= 3) is is_shallow] for is_shallow in (True, False)
    )
    heights = column(pads, "surface: rms, largest µm")
    worst = (
        [number(row[light].split(",")[1]) for row in shallow],
        [number(row[light].split(",")[1]) for row in deep],
    )
    yield made(
        page,
        "walls.least",
        "error of a pair's light to 3 mm deep, rms, least",
        min(column(shallow, light)),
        ".1f",
        "%",
    )
    yield made(page, "walls.rms", "the same, largest", max(column(shallow, light)), ".1f", "%")
    yield made(page, "walls.worst", "error of the worst pair's light to 3 mm deep", max(worst[0]), ".1f", "%")
    yield made(
        page,
        "walls.deep.rms",
        "error of a pair's light at 4.5 mm, rms, largest",
        max(column(deep, light)),
        ".1f",
        "%",
    )
    yield made(
        page, "walls.deep.worst", "error of the worst pair's light at 4.5 mm", max(worst[1]), ".1f", "%"
    )
    yield made(
        page, "walls.force", "error of force, largest", max(map(abs, column(pads, "force %"))), ".1f", "%"
    )
    yield made(page, "walls.force.least", "error of force, least", min(column(pads, "force %")), ".1f", "%")
    yield made(page, "walls.height.least", "error of the heights, rms, least", min(heights), ".0f", "µm")
    yield made(page, "walls.height", "error of the heights, rms, largest", max(heights), ".0f", "µm")
    yield made(
        page,
        "walls.small.rms",
        "error of a pair's light in a pad of 16 mm, rms, largest",
        max(column(small, light)),
        ".1f",
        "%",
    )
    yield made(
        page,
        "walls.small.height",
        "error of the heights in a pad of 16 mm, rms, largest",
        max(column(small, "surface: rms, largest µm")),
        ".0f",
        "µm",
    )
    for name, press in (
        ("middle", "pad middle"),
        ("wall", "pad near a wall"),
        ("corner", "pad in a corner"),
        ("oblong", "40 x 28 near a wall"),
        ("pair", "pair middle"),
    ):
        (row,) = (r for r in rows if r["press"] == press and number(r["depth mm"]) == 3)
        pair = row[light].split(",")
        yield made(
            page,
            f"walls.{name}.force",
            f"error of force, {press}, 3 mm deep",
            number(row["force %"]),
            "+.1f",
            "%",
        )
        yield made(
            page,
            f"walls.{name}.height",
            f"error of the heights, {press}, 3 mm deep, rms",
            number(row["surface: rms, largest µm"]),
            ".0f",
            "µm",
        )
        yield made(
            page,
            f"walls.{name}.rms",
            f"error of a pair's light, {press}, 3 mm deep, rms",
            number(pair[0]),
            ".1f",
            "%",
        )
        yield made(
            page,
            f"walls.{name}.worst",
            f"error of the worst pair's light, {press}, 3 mm deep",
            number(pair[1]),
            ".1f",
            "%",
        )


def light() -> Iterator[Figure]:
    """Light of a press, against a converged reference and against other tracers."""
    page = "docs/validation/light.csv"
    rows = {(row["surface"], row["accuracy"]): row for row in tables(page)[0]}
    analytic, pressed = rows["analytic", "standard"], rows["contact", "standard"]
    for name, row in (("analytic", analytic), ("contact", pressed)):
        yield made(
            page,
            f"light.{name}.rms",
            f"error of a pair's light at `standard`, {name} surfaces, rms",
            100 * float(row["total_rms"]),
            ".3f",
            "%",
        )
    yield made(
        page,
        "light.analytic.median",
        "error of a pair's light at `standard`, analytic surfaces, median",
        100 * float(analytic["total_median"]),
        ".3f",
        "%",
    )
    yield made(
        page,
        "light.analytic.worst",
        "error of the worst pair's light at `standard`, analytic surfaces",
        100 * float(analytic["total_worst"]),
        ".1f",
        "%",
    )
    yield made(
        page,
        "light.analytic.cost",
        "cost of a state at `standard`, analytic surfaces",
        float(analytic["core_seconds"]),
        ".2f",
        "core-s",
    )
    within = [100 * float(row["within_two"]) for row in rows.values()]
    yield made(
        page,
        "light.within.least",
        "errors within two stated standard errors, least of all rows",
        min(within),
        ".0f",
        "%",
    )
    yield made(page, "light.within.most", "the same, largest of all rows", max(within), ".0f", "%")

    page = "docs/validation/light.md"
    pad = {row["accuracy"]: row for row in table(page, "accuracy", "rms at 0.3 mm")}
    yield made(
        page,
        "light.pad.rms",
        "error of a pair's light on the paper's pad at `standard`, rms",
        number(pad["standard"]["rms"]),
        ".3f",
        "%",
    )
    yield made(
        page,
        "light.pad.worst",
        "error of the worst pair's light there",
        number(pad["standard"]["worst"]),
        ".1f",
        "%",
    )
    yield made(
        page,
        "light.pad.score.rms",
        "error of a pair's light on the paper's pad at `score`, rms",
        number(pad["score"]["rms"]),
        ".2f",
        "%",
    )
    yield made(
        page,
        "light.pad.score.worst",
        "error of the worst pair's light there",
        number(pad["score"]["worst"]),
        ".1f",
        "%",
    )
    yield made(
        page,
        "light.pad.draft.rms",
        "error of a pair's light on the paper's pad at `draft`, rms",
        number(pad["draft"]["rms"]),
        ".2f",
        "%",
    )

    page = "tests/validation/light/shapes_table.md"
    rows_ = table(page, "pad", "settings", "worst [joint standard errors]")
    score = [row for row in rows_ if row["settings"] == "score"]
    yield made(
        page,
        "shapes.pull",
        "discs, a stadium and crowned pads against the ray tracer: worst pair",
        max(column(rows_, "worst [joint standard errors]")),
        ".1f",
        "joint standard errors",
    )
    yield made(
        page,
        "shapes.stadium.pull",
        "the same of the stadium",
        max(column(rows_, "worst [joint standard errors]", lambda r: r["pad"] == "gripper-stadium")),
        ".1f",
        "joint standard errors",
    )
    yield made(
        page,
        "shapes.pull.least",
        "rms of these errors over pairs, least",
        min(column(rows_, "rms of these")),
        ".2f",
        "",
    )
    yield made(
        page,
        "shapes.pull.most",
        "rms of these errors over pairs, largest",
        max(column(rows_, "rms of these")),
        ".2f",
        "",
    )
    yield made(
        page,
        "shapes.round",
        "changes against the engine's finest light, disc and crowned pads, rms, largest",
        max(
            column(score, "finer", lambda r: r["pad"] in ("levi2013-disc", "crowned-40x25", "fingertip-dome"))
        ),
        ".2f",
        "%",
    )
    yield made(
        page,
        "shapes.stadium",
        "the same, the stadium",
        max(column(score, "finer", lambda r: r["pad"] == "gripper-stadium")),
        ".2f",
        "%",
    )
    yield made(
        page,
        "shapes.epoxy",
        "the same, receivers behind epoxy",
        max(column(score, "finer", lambda r: "epoxy" in r["pad"])),
        ".2f",
        "%",
    )

    page = "docs/validation/crossing.md"
    rows_ = [row for row in table(page, "surface", "largest pair %") if row["surface"] == "contact"]
    for depth in (4, 5):
        mine = [row for row in rows_ if number(row["depth mm"]) == depth]
        largest = [number(row["largest pair %"]) for row in mine if row["largest pair %"] != "-"]
        yield made(
            page,
            f"crossing.{depth}.mean",
            f"light across the crater, {depth} mm deep, mean of pairs",
            max(column(mine, MEAN)),
            ".3f",
            "%",
        )
        yield made(
            page,
            f"crossing.{depth}.worst",
            f"light across the crater, {depth} mm deep, worst pair",
            max(largest),
            ".1f",
            "%",
        )
    steep = [
        row
        for row in table(page, "surface", "largest pair %")
        if row["surface"] == "analytic" and number(row["depth mm"]) == 5
    ]
    yield made(
        page,
        "crossing.steep.mean",
        "light across a steeper crater, 5 mm deep, mean of pairs",
        max(column(steep, MEAN)),
        ".1f",
        "%",
    )
    yield made(
        page, "crossing.steep.worst", "the same, worst pair", max(column(steep, "largest pair %")), ".0f", "%"
    )


def renderer() -> Iterator[Figure]:
    """Light against Mitsuba."""
    page = "docs/validation/mitsuba.md"
    rows = table(page, "state", "all %", "largest difference, mirrored %")
    named = re.findall(
        r"^- `[\w-]+`: \S+ ([-+][\d.]+) ± [\d.]+ \(([-+][\d.]+)\)$",
        (ROOT / page).read_text("utf-8"),
        flags=re.MULTILINE,
    )
    yield made(page, "mitsuba.states", "states compared with Mitsuba", len(rows), "", "")
    yield made(
        page,
        "mitsuba.all",
        "light of all pairs together against Mitsuba, largest difference",
        max(map(abs, column(rows, "all %"))),
        ".2f",
        "%",
    )
    yield made(
        page,
        "mitsuba.pair",
        "largest difference of a pair that the walk resolves",
        max((abs(float(one)) for one, _ in named), default=0.0),
        ".1f",
        "%",
    )
