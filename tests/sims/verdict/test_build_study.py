"""The Monte Carlo over builds, on a judge whose answer is known; the real one on a few builds."""

import json

import numpy as np
import pytest
from scipy.stats import binomtest

from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.preset import preset
from optopad.design.spec.tolerances import build_tolerances
from optopad.sims.plots.builds import plot_builds
from optopad.sims.verdict.builds import Brief, build_study, drawn_values, facing_brief, remembered
from tests.sims.made_up_scores import made_up_band

PAIR = preset("piacenza2017-pair")
TOLERANCES = build_tolerances(PAIR)
HEIGHT = "receivers.height_mm"


def by_height(draft):
    """A deadband above 6.0 mm of receiver height; else a margin that grows downward."""
    over = draft.design.receivers.height_mm - 6.15
    return Brief(gap_mm=0.0, deadband_mm=max(over, 0.0), margin=2.0 if over > 0 else 4.0 - 10 * over)


def study(builds=256, judge=by_height, seed=0, **options):
    return build_study(PAIR, TOLERANCES, "made-up", judge, builds=builds, seed=seed, **options)


def test_the_share_that_keeps_the_verdict_is_the_tolerances_share():
    # uniform from 5.7 to 6.3, a deadband above 6.15: three quarters keep; Sobol points are off by 1 in 256 or less
    assert study().kept_share == pytest.approx(0.75, abs=1 / 256)


def test_the_interval_is_the_exact_binomial_one():
    found = study(builds=50)
    expected = binomtest(found.kept, 50).proportion_ci(0.95, method="exact")
    assert found.kept_interval == (expected.low, expected.high)
    assert found.kept_interval[0] < 0.75 < found.kept_interval[1]


def test_the_value_that_decides_ranks_first_and_the_others_are_not_told_from_nothing():
    found = study()
    assert found.tolerances[found.ranking[0]].path == HEIGHT
    correlations = dict(zip((one.path for one in TOLERANCES), found.rank_correlations(), strict=True))
    assert correlations[HEIGHT][0] == pytest.approx(-1.0, abs=1e-9)  # firmness falls with height throughout
    others = [interval for path, (_, *interval) in correlations.items() if path != HEIGHT]
    assert all(low < 0.0 < high for low, high in others)


def test_draws_lie_within_the_ends_and_have_the_distributions_mean_and_spread():
    values = drawn_values(TOLERANCES, 1024, 0)
    for one, column in zip(TOLERANCES, values.T, strict=True):
        width = one.high - one.low
        assert column.min() >= one.low
        assert column.max() <= one.high
        assert column.mean() == pytest.approx((one.low + one.high) / 2, abs=2e-3 * width)
        # a uniform's deviation is width / sqrt(12); of a normal cut at two deviations 0.8796 of them (Johnson 1994)
        sigma = width / np.sqrt(12) if one.distribution == "uniform" else 0.8796 * width / 4
        assert column.std() == pytest.approx(sigma, rel=5e-3)


def test_same_seed_same_builds_other_seed_others():
    assert (drawn_values(TOLERANCES, 100, 3) == drawn_values(TOLERANCES, 100, 3)).all()
    assert (drawn_values(TOLERANCES, 100, 3) != drawn_values(TOLERANCES, 100, 4)).any()


def test_builds_outside_the_models_are_counted_and_not_judged():
    def judge(draft):
        design = draft.design
        if design.receivers.height_mm > 6.15:
            raise ModelScopeError("receivers.height_mm: too high")
        return by_height(draft)

    found = study(judge=judge)
    assert found.unjudged == {"receivers.height_mm": 256 - found.builds}
    assert found.kept_share == 1.0
    json.dumps(found.to_json(), allow_nan=False)


def test_no_build_that_can_be_judged_is_refused():
    def judge(draft):
        design = draft.design
        if design.digest != PAIR.digest:
            raise ModelScopeError("cavity: out of scope")
        return by_height(draft)

    with pytest.raises(InputError, match="manufactured unit could"):
        study(judge=judge)


@pytest.mark.parametrize("builds", [0, 9, 100_001])
def test_a_useless_number_of_builds_is_refused(builds):
    with pytest.raises(InputError, match="--builds"):
        study(builds=builds)


def test_nothing_that_varies_is_refused():
    with pytest.raises(InputError, match="no value varies"):
        build_study(PAIR, (), "x", by_height, builds=20, seed=0)


def test_a_build_that_was_judged_is_not_judged_again():
    asked, kept = [], {}

    class Memo:
        get, put = staticmethod(kept.get), staticmethod(kept.__setitem__)

    def judge(draft):
        design = draft.design
        asked.append(design.digest)
        return by_height(draft)

    first = study(builds=20, judge=remembered(judge, Memo(), "x"))
    again = study(builds=20, judge=remembered(judge, Memo(), "x"))
    assert len(asked) == 21
    assert (first.margin == again.margin).all()


def test_a_study_in_which_all_builds_agree_has_no_correlations():
    found = study(builds=16, judge=lambda _: Brief(gap_mm=None, deadband_mm=0.0, margin=5.0))
    assert found.kept_share == 1.0
    assert found.kept_interval[0] == pytest.approx(0.025 ** (1 / 16))  # Clopper and Pearson's end for n of n
    assert found.rank_correlations()[0] == (0.0, -1.0, 1.0)


@pytest.mark.slow
def test_a_build_of_facing_rows_is_judged_as_the_design_is():
    thin, thick = (
        facing_brief(Draft.of(PAIR.with_(**{"cavity.clear_thickness_mm": thickness})), seed=0)
        for thickness in (8.0, 10.0)
    )
    assert thin.deadband_mm == 0.0
    assert thin.gap_mm == pytest.approx(
        0.55, abs=0.05
    )  # the score's own; coarse depths move boundaries by 0.04
    assert thick.deadband_mm == pytest.approx(
        3.0, abs=0.3
    )  # outer pairs 0.3 mm shorter or longer by the steps
    assert thick.margin < 3.0


def test_the_figure_says_the_share_and_names_every_value():
    found = study(builds=64)
    figure = plot_builds(found, made_up_band("the facing pairs", 0.0))
    assert f"{found.kept} of 64 manufactured units stay CONTIGUOUS" in figure.get_suptitle()
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert len(labels) == len(TOLERANCES)
    assert labels[0].startswith(HEIGHT)
