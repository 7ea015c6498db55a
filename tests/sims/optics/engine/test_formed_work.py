"""What is not traced on discs and crowned pads: faint chains through every point, and light that is known."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.sims.optics.accuracy import ACCURACIES
from optopad.sims.optics.engine.general import kernels as formed_kernels
from optopad.sims.optics.engine.general import pad as formed_pad
from optopad.sims.optics.engine.general.lower import windows_of
from optopad.sims.optics.engine.general.points import pitch_of, points_of, top_grid
from optopad.sims.optics.engine.general.rays import HALF_U
from optopad.sims.optics.scene.lower import scene_of

CROWN = scene_of(preset("crowned-40x25"))


def test_each_point_that_carries_chains_stands_for_four_of_its_batch() -> None:
    pad_walls = formed_pad.walls_of(CROWN)
    windows = np.vstack([windows_of(CROWN, kind)[:, :12] for kind in ("emitter", "receiver")])
    grid = top_grid(CROWN, windows, 0.5)
    some, every = (
        points_of(grid, CROWN, *pad_walls, np.array([0.5, 0.5]), all_chains=wanted)
        for wanted in (False, True)
    )
    assert (every.chains == 1.0).all()
    assert set(some.chains.tolist()) == {0.0, 4.0}
    for batch in range(4):
        own = some.batch == batch
        assert np.isclose(some.chains[own].mean(), 1.0, atol=0.05)


def test_the_grid_goes_by_images_and_not_by_the_narrowest_part_alone() -> None:
    emitters, receivers = windows_of(CROWN, "emitter"), windows_of(CROWN, "receiver")
    narrow = emitters.copy()
    narrow[:, HALF_U] = 0.15
    wide, close = (pitch_of(ACCURACIES["score"], of, receivers) for of in (emitters, narrow))
    assert 0.5 * wide < close < wide


def test_light_mirrored_through_the_same_points_is_traced_once_whatever_scatters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []
    zeros = np.zeros((2, 4, len(CROWN.emitter_wall), len(CROWN.receiver_wall)))
    monkeypatch.setattr(formed_pad, "_MIRRORED", {})
    monkeypatch.setattr(formed_kernels, "points_on", lambda at, *_top: at)
    monkeypatch.setattr(formed_kernels, "mirrored_matrix", lambda *given: asked.append(given) or zeros)
    walls, arcs = formed_pad.walls_of(CROWN)
    emitters, receivers = windows_of(CROWN, "emitter"), windows_of(CROWN, "receiver")
    top = formed_pad.formed_top(CROWN, np.zeros(2), None)
    layout = formed_pad.patch_layout(CROWN, walls, arcs)
    places = np.array([[1.0, 2.0, 0.1, 0.0, 1.0]])
    for moved in (places, places.copy(), places + 0.5):
        pad = formed_pad.FormedPad(
            scene=CROWN, emitters=emitters, receivers=receivers, walls=walls, arcs=arcs, top=top,
            patches=layout, flux=np.zeros((5, 10, 10)), error=np.zeros((10, 10)),
        )  # fmt: skip
        pad.mirrored(top, pad.every, moved)
    assert len(asked) == 2
