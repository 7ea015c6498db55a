"""Writes the ROS 2 packages where only the driver is installed: `python3 -m optopad.fabrication.ros2 ~/ros2_ws/src`.

`optopad driver ros2` does the same where the commands are installed.
"""

from __future__ import annotations

import sys
from pathlib import Path

from optopad.design.errors import OptopadError
from optopad.fabrication.ros2 import write_packages


def main(arguments: list[str]) -> int:
    """Write the packages into the folder that the only argument names; returns the exit code."""
    if len(arguments) != 1 or arguments[0].startswith("-"):
        print(
            "usage: python3 -m optopad.fabrication.ros2 FOLDER  (the src folder of a workspace)",
            file=sys.stderr,
        )
        return 2
    try:
        made = write_packages(Path(arguments[0]))
    except OptopadError as err:
        print(f"optopad: {err}", file=sys.stderr)
        return 2
    print(*made, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
