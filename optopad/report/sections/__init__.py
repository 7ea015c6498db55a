"""The sections of a page, one per file.

They may import `optopad.report.scenes` and `optopad.screen`, and design, sims and cad.
"""
