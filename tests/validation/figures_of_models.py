"""Figures of contact and light, each read from a stored result."""

from __future__ import annotations

import re
from collections.abc import Iterator

from tests.validation.stored import ROOT, Figure, Row, column, made, number, table, tables

MEAN = "mean % of the pair's signal"
"""Heading of a column."""


def contact() -> Iterator[Figure]:
    """Presses against finite elements."""
    page = "docs/validation/contact.md"
    rows = table(page, "force %", "surface rms µm", "the oracle's mm")
    deep = column(rows, "force %", lambda row: number(row["depth mm"]) >= 0.5)
    radius = [abs(number(row["contact radius mm"]) - number(row["the oracle's mm"])) for row in rows]
    yield made(page, "contact.shallow", max(column(rows, "force %")), ".1f")
    yield made(page, "contact.least", min(deep), ".1f")
    yield made(page, "contact.most", max(deep), ".1f")
    yield made(page, "contact.rms", max(column(rows, "surface rms µm")), ".1f")
    yield made(page, "contact.near", max(column(rows, "largest µm")), ".0f")
    yield made(page, "contact.far", max(column(rows, "largest to the wall µm")), ".0f")
    yield made(page, "contact.radius", max(radius), ".3f")

    page = "docs/validation/contact-interpolation.md"
    rows = table(page, "layer / R", "contact edge um")
    for name in ("flat", "crown"):
        kept = [row for row in rows if ("crown" in row) is (name == "crown")]
        yield made(page, f"between.{name}.force", max(map(abs, column(kept, "force %"))), ".2f")
        yield made(page, f"between.{name}.rms", max(column(kept, "surface rms um")), ".1f")
    yield made(page, "between.crown.edge", max(map(abs, column(kept, "contact edge um"))), ".0f")

    page = "tests/validation/contact/crown/crown_table.md"
    rows = table(page, "crown mm", "force %")
    wide = [row for row in rows if number(row["crown mm"]) >= 14]
    deep = column(wide, "force %", lambda row: number(row["depth mm"]) >= 0.5)
    thin = [row for row in rows if number(row["crown mm"]) == 12 and number(row["depth mm"]) == 3]
    yield made(page, "crown.force", max(deep), ".1f")
    yield made(page, "crown.rms", max(column(wide, "surface rms µm")), ".1f")
    yield made(page, "crown.thin.force", number(thin[0]["force %"]), "+.1f")
    yield made(page, "crown.thin.rms", number(thin[0]["surface rms µm"]), ".0f")

    page = "tests/validation/contact/crown/offset_table.md"
    rows = table(page, "press", "thickness", "force %")
    surface = "surface to 3 radii: rms, largest µm"
    beside = [r for r in rows if r["thickness"] == ("local" if r["press"] == "flat" else "along the normal")]
    small = column(beside, surface, lambda r: r["press"] != "dome" and r["depth mm"] == "2")
    steep = column(beside, surface, lambda r: r["press"] == "dome" and r["depth mm"] == "3")
    yield made(page, "beside.force", max(map(abs, column(beside, "force %"))), ".1f")
    yield made(page, "beside.least", min(small), ".0f")
    yield made(page, "beside.most", max(small), ".0f")
    yield made(page, "beside.steep", max(steep), ".0f")

    page = "docs/validation/contact-crowns.md"
    surface = "surface to 3 tip radii: rms, largest µm"
    rows = table(page, "pressed", surface)
    for name, press in (("middle", "the middle"), ("round", "the centre of a half round")):
        mine = [row for row in rows if row["pressed"] == press]
        worst = max(column(mine, "force"), key=abs)
        sign = ".1f" if name == "middle" else "+.1f"
        yield made(page, f"stadium.{name}.force", worst, sign)
        yield made(page, f"stadium.{name}.rms", max(column(mine, surface)), ".0f")


def walls() -> Iterator[Figure]:
    """Presses near walls, against finite elements in three dimensions."""
    page = "docs/validation/walls.md"
    rows = table(page, "press", "light: rms, largest %")
    light = "light: rms, largest %"
    heights = "surface: rms, largest µm"
    pads = [row for row in rows if row["press"] != "small pad"]
    small = [row for row in rows if row["press"] == "small pad"]
    shallow = [row for row in pads if number(row["depth mm"]) <= 3]
    deep = [row for row in pads if number(row["depth mm"]) > 3]
    worst = [max(number(row[light].split(",")[1]) for row in some) for some in (shallow, deep)]
    yield made(page, "walls.least", min(column(shallow, light)), ".1f")
    yield made(page, "walls.rms", max(column(shallow, light)), ".1f")
    yield made(page, "walls.worst", worst[0], ".1f")
    yield made(page, "walls.deep.rms", max(column(deep, light)), ".1f")
    yield made(page, "walls.deep.worst", worst[1], ".1f")
    yield made(page, "walls.force", max(map(abs, column(pads, "force %"))), ".1f")
    yield made(page, "walls.force.least", min(column(pads, "force %")), ".1f")
    yield made(page, "walls.height.least", min(column(pads, heights)), ".0f")
    yield made(page, "walls.height", max(column(pads, heights)), ".0f")
    yield made(page, "walls.small.rms", max(column(small, light)), ".1f")
    yield made(page, "walls.small.height", max(column(small, heights)), ".0f")
    for name, press in (
        ("middle", "pad middle"),
        ("wall", "pad near a wall"),
        ("corner", "pad in a corner"),
        ("oblong", "40 x 28 near a wall"),
        ("pair", "pair middle"),
    ):
        (row,) = (r for r in rows if r["press"] == press and number(r["depth mm"]) == 3)
        pair = row[light].split(",")
        yield made(page, f"walls.{name}.force", number(row["force %"]), "+.1f")
        yield made(page, f"walls.{name}.height", number(row[heights]), ".0f")
        yield made(page, f"walls.{name}.rms", number(pair[0]), ".1f")
        yield made(page, f"walls.{name}.worst", number(pair[1]), ".1f")


def objects() -> Iterator[Figure]:
    """Contact and light of objects."""
    page = "docs/validation/objects.md"
    depth = "% of the depth"
    rows = table(page, "object", depth)

    def widths(row: Row) -> list[float]:
        """Errors of the half widths, without that of the area."""
        return [number(one) for one in row["half width; x, y, area %"].split(",")[:2]]

    refused = column(rows, depth, lambda row: row["covered"] == "refused")
    yield made(page, "objects.refused.least", min(refused), ".1f")
    yield made(page, "objects.refused.most", max(refused), ".1f")
    for name, fitted in (("fitted", "yes"), ("short", "no")):
        kept = [row for row in rows if (row["fitted"], row["covered"]) == (fitted, "yes")]
        yield made(page, f"objects.{name}.force", max(map(abs, column(kept, "force %"))), ".1f")
        yield made(page, f"objects.{name}.top", max(column(kept, depth)), ".1f")
        yield made(page, f"objects.{name}.width", max(map(abs, (w for r in kept for w in widths(r)))), ".1f")

    rows = table(page, "press", "contact radius %", depth)
    force = [abs(one) for one in column(rows, "force %")]
    yield made(page, "objects.ball.least", min(force), ".1f")
    yield made(page, "objects.ball.most", max(force), ".1f")
    yield made(page, "objects.ball.top", max(column(rows, depth)), ".1f")

    grid, own = "solved top as a grid: rms, largest %", "top of the object's press: rms, largest %"
    rows = table(page, "preset", grid)
    yield made(page, "objects.grid", max(column(rows, grid)), ".2f")
    cost = max(column(rows, "core-s a state", lambda row: row["preset"] == "piacenza2017-pad"))
    yield made(page, "objects.grid.cost", cost, ".2f")
    flat = [row for row in rows if row["preset"] != "fingertip-dome" and row[own] != "refused"]
    share = [100 * number(row[own]) / number(row["change rms %"]) for row in flat]
    yield made(page, "objects.share.least", min(share), ".0f")
    yield made(page, "objects.share.most", max(share), ".0f")

    light = "light: rms, largest %"
    for row in table(page, "depth mm", "model", light):
        if row["depth mm"] == "1":
            name = {"objects": "object", "balls": "ball"}.get(row["model"], "mesh")
            part = 100 * number(row[light]) / number(row["change rms %"])
            yield made(page, f"objects.dome.{name}", part, ".0f")
    rows = table(page, "presses", "difference: rms, largest %")
    sizes = [(row["presses"], *row["difference: rms, largest %"].split(",")) for row in rows]
    yield made(page, "objects.turn", number(sizes[0][1]), ".2f")
    shallow = [number(largest) for words, _, largest in sizes if "0.3 mm deep" in words]
    yield made(page, "objects.sum", max(shallow), ".2f")


def sideways() -> Iterator[Figure]:
    """Contact and light of sideways loads."""
    page = "docs/validation/shear.md"
    depth, mirror = "% of the depth", "opposite motion, turned by 180°, against it: rms, largest %"
    rows = [row for row in table(page, "object", "pull/E") if row["force %"] != "refused"]
    moved = [row for row in rows if number(row["shear mm"]) > 0.0]
    for name in ("long cylinder", "ball"):
        kept = [row for row in moved if row["object"].startswith(name) and "friction" not in row["object"]]
        figure = f"shear.{name.split()[-1]}"
        yield made(page, f"{figure}.force", max(map(abs, column(kept, "force %"))), ".1f")
        yield made(page, f"{figure}.pull", max(map(abs, column(kept, "pull %"))), ".0f")
        yield made(page, f"{figure}.top", max(column(kept, depth)), ".1f")
    rows = table(page, "depth mm", mirror)
    yield made(page, "shear.mirror", max(column(rows, mirror)), ".2f")
    yield made(page, "shear.stated", max(column(rows, "stated: rms %")), ".2f")


def touches() -> Iterator[Figure]:
    """Two tips at once, against finite strains and the ray tracer."""
    page, other = "docs/validation/touches.md", "by the other: solved, model %"
    rows = table(page, "apart mm", other)
    yield made(page, "touches.force", max(map(abs, column(rows, "force %"))), ".1f")
    for name, deepest in (("touches.top.shallow", 2.0), ("touches.top", 3.0)):
        kept = [row for row in rows if number(row["depth mm"]) <= deepest]
        yield made(page, name, max(column(kept, "% of the depth")), ".1f")
    shares = [tuple(map(float, row[other].split(","))) for row in rows]
    yield made(page, "touches.other.least", min(solved for solved, _ in shares), ".1f")
    yield made(page, "touches.other.most", max(solved for solved, _ in shares), ".1f")
    yield made(page, "touches.other.off", max(abs(model - solved) for solved, model in shares), ".1f")
    worst, pad = "worst pair, joint standard errors", "piacenza2017-pad"
    rows = table(page, "preset", worst)
    yield made(page, "touches.light.pull", max(column(rows, worst, lambda r: r["preset"] == pad)), ".1f")
    yield made(page, "touches.light.shapes", max(column(rows, worst, lambda r: r["preset"] != pad)), ".1f")
    yield made(page, "touches.light.pull.least", min(column(rows, "rms of these")), ".2f")
    yield made(page, "touches.light.pull.most", max(column(rows, "rms of these")), ".2f")
    sums = [abs(float(row["all: off, error %"].split(",")[0])) for row in rows]
    yield made(page, "touches.light.all", max(sums), ".1f")
    found, single = "two found %", "called one %"
    rows = {(row["preset"], row["depth mm"]): row for row in table(page, "preset", found)}
    deep = [row for (name, depth), row in rows.items() if name == pad and number(depth) >= 0.3]
    yield made(page, "touches.found", min(column(deep, found)), ".1f")
    yield made(page, "touches.single", min(column(deep, single)), ".1f")
    yield made(page, "touches.found.light", number(rows[pad, "0.1"][found]), ".0f")
    yield made(page, "touches.found.gripper", number(rows["gripper-teensy", "0.5"][found]), ".0f")
    yield made(page, "touches.found.gripper.deep", number(rows["gripper-teensy", "1"][found]), ".0f")


def light() -> Iterator[Figure]:
    """Light of a press, against a converged reference and against other tracers."""
    page = "docs/validation/light.csv"
    rows = {(row["surface"], row["accuracy"]): row for row in tables(page)[0]}
    analytic, pressed = rows["analytic", "standard"], rows["contact", "standard"]
    for name, row in (("analytic", analytic), ("contact", pressed)):
        yield made(page, f"light.{name}.rms", 100 * float(row["total_rms"]), ".3f")
    yield made(page, "light.analytic.median", 100 * float(analytic["total_median"]), ".3f")
    yield made(page, "light.analytic.worst", 100 * float(analytic["total_worst"]), ".1f")
    yield made(page, "light.analytic.cost", float(analytic["core_seconds"]), ".2f")
    within = [100 * float(row["within_two"]) for row in rows.values()]
    yield made(page, "light.within.least", min(within), ".0f")
    yield made(page, "light.within.most", max(within), ".0f")

    page = "docs/validation/light.md"
    pad = {row["accuracy"]: row for row in table(page, "accuracy", "rms at 0.3 mm")}
    yield made(page, "light.pad.rms", number(pad["standard"]["rms"]), ".3f")
    yield made(page, "light.pad.worst", number(pad["standard"]["worst"]), ".1f")
    yield made(page, "light.pad.score.rms", number(pad["score"]["rms"]), ".2f")
    yield made(page, "light.pad.score.worst", number(pad["score"]["worst"]), ".1f")
    yield made(page, "light.pad.draft.rms", number(pad["draft"]["rms"]), ".2f")

    page = "tests/validation/light/shapes_table.md"
    worst = "worst [joint standard errors]"
    rows_ = table(page, "pad", "settings", worst)
    score = [row for row in rows_ if row["settings"] == "score"]
    stadium, round_ = ["gripper-stadium"], ["levi2013-disc", "crowned-40x25", "fingertip-dome"]
    yield made(page, "shapes.pull", max(column(rows_, worst)), ".1f")
    yield made(page, "shapes.stadium.pull", max(column(rows_, worst, lambda r: r["pad"] in stadium)), ".1f")
    yield made(page, "shapes.pull.least", min(column(rows_, "rms of these")), ".2f")
    yield made(page, "shapes.pull.most", max(column(rows_, "rms of these")), ".2f")
    yield made(page, "shapes.round", max(column(score, "finer", lambda r: r["pad"] in round_)), ".2f")
    yield made(page, "shapes.stadium", max(column(score, "finer", lambda r: r["pad"] in stadium)), ".2f")
    yield made(page, "shapes.epoxy", max(column(score, "finer", lambda r: "epoxy" in r["pad"])), ".2f")

    page = "tests/validation/light/floor_table.md"
    worst = "worst pair, joint standard errors"
    rows_ = table(page, "pad", "press mm", worst)
    yield made(page, "floor.states", len(rows_))
    yield made(page, "floor.pull", max(column(rows_, worst)), ".1f")
    yield made(
        page, "floor.all", max(abs(number(row["all: off, error %"].split(",")[0])) for row in rows_), ".1f"
    )

    page = "docs/validation/crossing.md"
    rows_ = [row for row in table(page, "surface", "largest pair %") if row["surface"] == "contact"]
    for depth in (4, 5):
        mine = [row for row in rows_ if number(row["depth mm"]) == depth]
        largest = [number(row["largest pair %"]) for row in mine if row["largest pair %"] != "-"]
        yield made(page, f"crossing.{depth}.mean", max(column(mine, MEAN)), ".3f")
        yield made(page, f"crossing.{depth}.worst", max(largest), ".1f")
    steep = [
        row
        for row in table(page, "surface", "largest pair %")
        if row["surface"] == "analytic" and number(row["depth mm"]) == 5
    ]
    yield made(page, "crossing.steep.mean", max(column(steep, MEAN)), ".1f")
    yield made(page, "crossing.steep.worst", max(column(steep, "largest pair %")), ".0f")


def renderer() -> Iterator[Figure]:
    """Light against Mitsuba."""
    page = "docs/validation/mitsuba.md"
    rows = table(page, "state", "all %", "largest difference, mirrored %")
    named = re.findall(
        r"^- `[\w-]+`: \S+ ([-+][\d.]+) ± [\d.]+ \(([-+][\d.]+)\)$",
        (ROOT / page).read_text("utf-8"),
        flags=re.MULTILINE,
    )
    yield made(page, "mitsuba.states", len(rows))
    yield made(page, "mitsuba.all", max(map(abs, column(rows, "all %"))), ".2f")
    yield made(page, "mitsuba.pair", max((abs(float(one)) for one, _ in named), default=0.0), ".1f")
