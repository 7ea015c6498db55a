"""Entry points for users, Python and terminal: from one design file to mold, verdict and driver.

    import optopad

    design = optopad.load("piacenza2017-pair")
    optopad.score(design).verdict
    optopad.score(design.with_(**{"cavity.clear_thickness_mm": 10})).deadbands_mm

Modules, each using only earlier ones: work, screen, results, report, jobs, sensor, then the entry points api (Python)
and cli (terminal).
"""

from optopad.api import check, compare, improve, load, predict, presets, run, save, score, sweep

__all__ = ["check", "compare", "improve", "load", "predict", "presets", "run", "save", "score", "sweep"]
