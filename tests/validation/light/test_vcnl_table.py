"""The walk of one chip under a block against closed forms and the engine, and the page's tables against the counts."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.arrays import FloatArray
from tests.validation.light import vcnl_table
from tests.validation.light.vcnl_walk import Block, Pattern, fresnel, outside_reflectance, received

LAMBERTIAN = Pattern.of_half_angle(60.0)
BOX = Block(
    size=(4.0, 4.0, 2.0),
    index=1.41,
    floor=1.0,
    wall=1.0,
    white=1.0,
    emitter=(1.0, 2.0),
    receiver=(2.6, 2.0),
    emitter_width=0.5,
    receiver_width=2.0,
)


def everything(cosine: FloatArray) -> FloatArray:
    return np.ones_like(cosine)


@pytest.mark.parametrize("cover", ["wet", "gap"])
def test_all_light_of_a_white_box_ends_in_its_receiver(cover: str) -> None:
    share, error, orders = received(BOX.with_(cover=cover), LAMBERTIAN, everything, 20_000, 1)
    assert share == pytest.approx(1.0, abs=max(0.01, 4.0 * error))
    assert orders.sum() == pytest.approx(share)


def test_a_white_plane_in_air_returns_the_integral_over_it() -> None:
    height, apart, width = 3.0, 2.6, 0.05
    air = Block(
        size=(80.0, 80.0, height),
        index=1.0,
        cover="wet",
        white=0.9,
        emitter=(40.0 - apart / 2, 40.0),
        receiver=(40.0 + apart / 2, 40.0),
        emitter_width=width,
        receiver_width=width,
    )
    share, error, _ = received(air, LAMBERTIAN, everything, 40_000, 2)
    step = 0.1
    x, y = np.meshgrid(*(np.arange(-40.0 + step / 2, 40.0, step),) * 2)
    there, back = ((x - side) ** 2 + y**2 + height**2 for side in (-apart / 2, apart / 2))
    exact = 0.9 * width**2 * step**2 * (height**4 / (np.pi**2 * there**2 * back**2)).sum()
    assert share == pytest.approx(exact, rel=0.01, abs=4.0 * error)


@pytest.mark.parametrize("wall", [0.0, None])
def test_a_bare_top_over_a_black_floor_returns_its_mirror_image_and_bare_sides_theirs(
    wall: float | None,
) -> None:
    height, apart, width, index = 3.0, 2.6, 0.05, 1.41
    block = Block(
        size=(12.0, 12.0, height),
        index=index,
        wall=wall,
        emitter=(6.0 - apart / 2, 6.0),
        receiver=(6.0 + apart / 2, 6.0),
        emitter_width=width,
        receiver_width=width,
    )
    share, _, _ = received(block, LAMBERTIAN, everything, 20_000, 3)
    exact = 0.0
    most = 0 if wall is not None else 3
    for i in range(-most, most + 1):
        for j in range(-most, most + 1):
            x = 12.0 * i + (6.0 + apart / 2 if i % 2 == 0 else 6.0 - apart / 2) - (6.0 - apart / 2)
            way = np.array([x, 12.0 * j, 2.0 * height])
            cosines = np.abs(way) / np.linalg.norm(way)
            mirrored = fresnel(cosines, index, 1.0) ** [abs(i), abs(j), 1]
            exact += mirrored.prod() * cosines[2] ** 2 * width**2 / (np.pi * (way**2).sum())
    assert share == pytest.approx(exact, rel=0.02)


def test_diffuse_light_at_the_outer_face_of_silicone_is_reflected_as_published() -> None:
    assert outside_reflectance(1.5) == pytest.approx(0.092, abs=5e-4)  # Duntley 1942: 9.2 % for glass


@pytest.mark.parametrize("scene", [(3.0, 0.15, 0.05, None), (3.0, 0.15, 0.05, 0.9), (2.0, 0.3, 0.5, 0.9)])
def test_engine_and_walk_agree_on_one_chip(scene: tuple[float, float, float, float | None]) -> None:
    (engine, own), (walk, error) = vcnl_table.both(scene, 20_000, 6)
    assert abs(engine - walk) < 3.5 * np.hypot(own, error)
    assert engine == pytest.approx(walk, rel=0.03)


def test_the_page_has_the_counts_of_the_table() -> None:
    page = vcnl_table.PAGE.read_text(encoding="utf-8")
    assert vcnl_table.counts_table() in page
    assert vcnl_table.measured_table() in page


def test_the_nominal_prediction_is_the_page_s() -> None:
    page = vcnl_table.PAGE.read_text(encoding="utf-8")
    row = next(line for line in page.splitlines() if line.startswith("| all nominal"))
    stated = [float(cell) for cell in row.split("|")[3:-1]]
    found = vcnl_table.predicted(vcnl_table.NOMINAL, 10_000, 5)
    assert list(found.values()) == pytest.approx(stated, rel=0.06)
