"""``python -m optopad.report`` draws plots and writes the page for another process (`optopad.work.beside`)."""

from __future__ import annotations

import gc

from optopad.report.page import write_report
from optopad.report.sections.early import write_early
from optopad.work import serve

if __name__ == "__main__":
    gc.disable()  # the process is short, and plots consist of many small objects
    serve(write_early, write_report)
