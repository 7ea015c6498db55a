"""The recorded residues: the model's law fits them, the simpler ones do not, and the catalogue's band holds them."""

from __future__ import annotations

import numpy as np

from optopad.design.fields.packaged import data_quantities
from optopad.sims.contact.load_protocol import StandardLinearSolid
from tests.validation.learning.memory_table import FOLDER, HYPERBOLA, LAWS, loop_share, recorded, share_needed
from tests.validation.stored import tables


def test_the_law_fits_every_recorded_signal_and_the_catalogue_holds_its_parameters() -> None:
    rows, times, shares = recorded()
    fits = [HYPERBOLA.fitted(times, one) for one in shares]
    assert max(misfit for _, misfit in fits) < 0.09
    for values, band in zip(
        np.array([one for one, _ in fits]).T, data_quantities("memory.toml").values(), strict=True
    ):
        assert band.low is not None
        assert band.high is not None
        assert band.low <= values.min() <= band.value * 1.05
        assert band.value * 0.95 <= values.max() <= band.high
    assert len(rows) == 23


def test_of_the_laws_with_two_parameters_it_is_the_closest() -> None:
    _, times, shares = recorded()
    misfit = {law.name: np.median([law.fitted(times, one)[1] for one in shares]) for law in LAWS[:3]}
    assert min(misfit, key=lambda name: misfit[name]) == HYPERBOLA.name


def test_a_slow_loop_of_a_fast_solid_is_narrow_and_the_needed_share_gives_the_measured_one() -> None:
    """A linear spring at one speed, much slower than the solid: 4 s / (1 - s) x time constant / time of the way in."""
    (loops,) = tables(f"{FOLDER}/remodel_loops.csv")
    one = loops[0] | {"force_exponent": "1", "up_s": "100", "down_s": "100"}
    solid = StandardLinearSolid(relaxed_share=0.04, time_constant_s=0.1)
    assert np.isclose(loop_share(one, solid), 4.0 * solid.excess * 0.1 / 100.0, rtol=0.02)
    needed = StandardLinearSolid(relaxed_share=share_needed(loops[0], 10.0), time_constant_s=10.0)
    assert np.isclose(100.0 * loop_share(loops[0], needed), float(loops[0]["force_loop_percent"]), rtol=1e-6)
