"""What a trial found, in words."""

from __future__ import annotations

from optopad.screen.numbers import counted
from sims.continuity.trials import ENOUGH_MARGIN
from sims.verdict.trial import Move, Trial

NAMES = {
    "emitters.height_mm": "emitters",
    "receivers.height_mm": "receivers",
    "cavity.clear_thickness_mm": "clear layer",
}


def fix_words(trial: Trial | None) -> str:
    """What helps, and the verdict that was traced with it; empty where nothing that was tried helps."""
    if trial is None or trial.found == "none":
        return ""
    moved = ", ".join(_moved(one) for one in trial.moves)
    verdict = f"{moved}: {verdict_words(trial)} (traced: {trial.judged})"
    return f"too few components: with {verdict}" if trial.found == "more parts" else verdict


def verdict_words(trial: Trial) -> str:
    """The verdict of a trial, its usable depth and its margin."""
    depth = "" if trial.usable_mm is None else f" to {trial.usable_mm:.3g} mm"
    margin = "" if trial.margin is None else f", margin {trial.margin:.1f} sigma"
    return f"{trial.verdict}{depth}{margin}"


def command_words(trial: Trial) -> str:
    """What the next command does, in short: the components that it moves, and the traced verdict."""
    parts = " and ".join(one.parts for one in trial.moves if one.parts)
    moves = f"moves {parts}; " if parts else ""
    return f"{moves}trial: {verdict_words(trial)}"


def no_fix_words(trial: Trial | None) -> str:
    """That no move helps, and what was tried; empty where one does or none was tried."""
    if trial is None or trial.found == "move" or not trial.tried:
        return ""
    helps = "reaches deeper" if trial.kind == "fade" else "fixes it at every location"
    more = ", nor does one more component a side" if trial.found == "none" and trial.more_parts_tried else ""
    within = (
        f"of {counted(len(trial.tried), 'move')} of heights and thickness by up to {trial.farthest_mm:g} mm"
    )
    return f"none {within} {helps}{more} (margin {ENOUGH_MARGIN:g} sigma or more)"


def set_options(trial: Trial) -> str:
    """The moves as options of a command."""
    return " ".join(f"--set {one.path}={one.to:g}" for one in trial.moves)


def _moved(move: Move) -> str:
    if move.path not in NAMES:
        field = move.path.rpartition(".")[2].replace("_", " ")
        return f"{field} {move.to:g}" + ("" if move.was is None else f" in place of {move.was:g}")
    assert move.was is not None
    named = f"{NAMES[move.path]} {move.parts}".strip()
    return f"{named} from {move.was:g} to {move.to:g} mm"
