"""Accuracy of the light integration: named settings, custom settings, or a required relative error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """Settings of the light integration: how finely each kind of light is sampled.

    An *image* is one reflection of an emitter in the top, as a receiver sees it. A *replicate* is one repetition of the
    sampling with different random offsets.

    Attributes
    ----------
    replicates : number of replicates, 2 or more; 1 is enough for discs, crowned pads and tops on grids [-]
    rings, columns : cells of the top around a press in which images are searched [-]
    whole_ratio : an image is summed path by path if its largest flux density is at most this multiple of its smallest.
        If 0, every image is summed over points of the top [-]
    image_step : motion of an image from one point of the top to the next, relative to its size, for an image with 3 %
        of the untouched flux; smaller for brighter images [-]
    top_rings, top_columns : points of the top for scattered light and for several reflections [-]
    repeat_share : largest share of a pair's untouched flux that one sample of light reflected several times may
        represent; the flux counts as at least 3 % of the emitter's brightest pair's [-]
    nodes_emitter, nodes_column, nodes_height : numbers of Gauss nodes for direct light over the emitter, the receiver's
        columns, and the height of a column [-]
    few_emitter, few_receiver, most_emitter, most_receiver : numbers of Gauss nodes for images summed path by path: few
        if the flux density varies little, most if it varies much [-]
    flat_nodes : number of Gauss nodes for the untouched pad [-]
    reference_rays : rays per emitter and receiver for the untouched pad's scattered light, a power of two [-]
    wall_rays : rays per emitter, receiver and state between smooth walls, a power of two [-]
    ray_share : power, relative to the mean over a receiver's rays, below which a ray is followed only at random
        (Russian roulette); for an emitter's rays a tenth of this, as they also find repeated reflections [-]
    """

    replicates: int = 2
    rings: int = 24
    columns: int = 64
    whole_ratio: float = 8.0
    image_step: float = 0.2
    top_rings: int = 24
    top_columns: int = 60
    repeat_share: float = 4e-3
    nodes_emitter: int = 4
    nodes_column: int = 16
    nodes_height: int = 4
    few_emitter: int = 3
    few_receiver: int = 4
    most_emitter: int = 4
    most_receiver: int = 5
    flat_nodes: int = 12
    reference_rays: int = 65536
    wall_rays: int = 4096
    ray_share: float = 0.2


ACCURACIES = {
    "draft": Accuracy(
        image_step=0.35, top_rings=14, top_columns=36, repeat_share=1e-2, wall_rays=1024, ray_share=0.5
    ),
    "score": Accuracy(  # for maps of many states
        rings=16,
        columns=40,
        image_step=0.35,
        top_rings=10,
        top_columns=24,
        repeat_share=1e-2,
        wall_rays=1024,
        ray_share=0.5,
    ),
    "standard": Accuracy(),
    "fine": Accuracy(
        rings=32,
        columns=96,
        image_step=0.09,
        top_rings=48,
        top_columns=120,
        repeat_share=5e-4,
        nodes_emitter=6,
        nodes_column=32,
        nodes_height=6,
        few_emitter=4,
        few_receiver=5,
        most_emitter=5,
        most_receiver=6,
        reference_rays=262144,
        wall_rays=16384,
        ray_share=0.1,
    ),
    "reference": Accuracy(
        replicates=4,
        rings=40,
        columns=120,
        image_step=0.04,
        top_rings=80,
        top_columns=200,
        repeat_share=1e-4,
        nodes_emitter=6,
        nodes_column=32,
        nodes_height=6,
        few_emitter=4,
        few_receiver=6,
        most_emitter=6,
        most_receiver=8,
        reference_rays=262144,
        wall_rays=65536,
        ray_share=0.03,
    ),
}

MIRRORED_FINER = replace(
    ACCURACIES["score"],
    rings=ACCURACIES["standard"].rings,
    columns=ACCURACIES["standard"].columns,
    image_step=ACCURACIES["standard"].image_step,
    repeat_share=2e-3,
)
"""Settings that treat light mirrored by the top as in "standard" or finer, all other light as in "score". Voxels may be
left undecided near contact by the error of images, and deep down by the error of light mirrored several times. On the
paper's pad the error at 0.3 mm is 0.05 % rms, as with "standard"."""

CONTACT_FINER = replace(
    MIRRORED_FINER,
    image_step=0.09,
    top_rings=ACCURACIES["standard"].top_rings,
    top_columns=ACCURACIES["standard"].top_columns,
)
"""Settings with finer images and a finer top, for presses that `MIRRORED_FINER` leaves unresolved. Its error of images
adds relative noise to bright pairs, which hides the information of dim ones: on a pad of 34 x 18 mm with 36 pairs, 12 %
of the volume was not resolved at 2000 counts, 7 % at 1200 and 2 % with a thinner layer; with these settings, 0 %."""

LADDER = tuple(ACCURACIES[name] for name in ("draft", "standard", "fine", "reference"))
"""Settings that are tried in turn for a required relative error, cheapest first."""


def accuracy_of(accuracy: str | Accuracy, least: int = 2) -> Accuracy:
    """Settings of a given name, or the given settings themselves.

    least : least number of replicates that give a standard error

    Raises
    ------
    InputError : the name is unknown, or there are fewer replicates.
    """
    if isinstance(accuracy, str):
        if accuracy not in ACCURACIES:
            raise InputError(
                f"accuracy: {accuracy!r}, must be one of {', '.join(ACCURACIES)}, or a relative error as 0.001"
            )
        return ACCURACIES[accuracy]
    if accuracy.replicates < least:
        raise InputError(
            f"accuracy: {accuracy.replicates} replicates, needs {least} or more for a standard error"
        )
    return accuracy


def checked_target(target: float) -> float:
    """Return a required relative error unchanged if it is valid.

    Raises
    ------
    InputError : the error is not above 0 and below 1.
    """
    if not (math.isfinite(target) and 0.0 < target < 1.0):
        raise InputError(
            f"accuracy: {target:g}, a relative error must lie above 0 and below 1; try 0.001 (0.1 %)"
        )
    return target


@dataclass(frozen=True, kw_only=True)
class LightSignals:
    """Flux from each emitter to each receiver in each state, divided by the emitter's power.

    A state is the untouched pad or one set of simultaneous presses.

    Attributes
    ----------
    flux : (state, emitter, receiver) sum over path classes [-]
    by_class : for each path class (direct, top, skirt, wall, diffuse) its (state, emitter, receiver) flux [-]; the sum
        of top and skirt is all light mirrored by the top
    standard_error : (state, emitter, receiver) standard error of `flux` [-]; `engine.trace_states` says what it covers
    change_error : (state, emitter, receiver) part of the standard error that differs from state to state [-], for the
        difference of two states. If None, this is all of the standard error
    presses : (state, 3) x, y and depth of the press, or (state, tip, 3) if some state has several tips [mm]; a depth of
        0 or less means untouched
    digest : hash of the design
    seed : seed of the random offsets
    relative_error : (state,) root mean square, over the requested pairs, of the ratio of standard error to untouched
        flux [-]
    is_met : (state,) whether `relative_error` is within the required error; True if no error was required
    """

    flux: FloatArray
    by_class: Mapping[str, FloatArray]
    standard_error: FloatArray
    presses: FloatArray
    digest: str
    seed: int
    relative_error: FloatArray | None = None
    is_met: BoolArray | None = None
    change_error: FloatArray | None = None

    @property
    def error_of_changes(self) -> FloatArray:
        """(state, emitter, receiver) error for comparing states [-]: `change_error`, or `standard_error` if None."""
        return self.standard_error if self.change_error is None else self.change_error
