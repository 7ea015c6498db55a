"""Entry points for users, in Python and in the terminal: from one design file to mold, verdict and driver.

    import optopad

    design = optopad.load("piacenza2017-pair")
    optopad.score(design).verdict
    optopad.score(design.with_(**{"cavity.clear_thickness_mm": 10})).deadbands_mm

Parts, each importing only earlier ones: work, screen, results, report, jobs, sensor. Entry points: api (Python), cli
(terminal).
"""

from optopad.api import check, compare, improve, load, predict, presets, run, save, score, sweep

__all__ = ["check", "compare", "improve", "load", "predict", "presets", "run", "save", "score", "sweep"]
