"""Programs that the studio's buttons start: commands of optopad, and the mold, each in a process that can be ended."""

from __future__ import annotations

import json
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.cad.mesh import Mesh, read_stl
from optopad.design.errors import OptopadError
from optopad.design.files import temporary_folder
from optopad.design.io import save_design
from optopad.design.mold.outline import bed_lift_mm
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle_name
from optopad.studio.session import Said
from optopad.work import started

Tell = Callable[[Said], None]


@dataclass(frozen=True, kw_only=True)
class Ghost:
    """An improved design that `optopad improve` verified, with the kind of improvement and the changed fields."""

    kind: str
    changes: dict[str, Any]
    design: SensorDesign


class Task:
    """Runs one program at a time, `optopad improve` or `optopad run`, and reads the files with its result.

    Parameters
    ----------
    out : folder of the bundles
    tell : called with messages about the progress, on a thread of the task
    """

    def __init__(self, out: Path, tell: Tell) -> None:
        self.out, self._tell = out, tell
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._is_ended = False

    @property
    def is_running(self) -> bool:
        """Whether a task is running."""
        return self._process is not None and self._process.poll() is None

    def improve(self, design: SensorDesign, done: Callable[[tuple[Ghost, ...]], None]) -> bool:
        """Search for improvements of a design and pass them to `done`; returns False if another task is running."""

        began = time.time()

        def finish() -> None:
            folder = self._made_since(began, f"improve-{design.name}-*/improve.json").parent
            document = json.loads((folder / "improve.json").read_text(encoding="utf-8"))
            ghosts = tuple(
                Ghost(kind=one["kind"], changes=one["changes"], design=design.with_(**one["changes"]))
                for one in document["alternatives"]
            )
            self._tell(Said(text=_found(len(ghosts), folder), is_bad=not ghosts))
            done(ghosts)

        return self._start("improve", design, finish)

    def _made_since(self, began: float, pattern: str) -> Path:
        """The newest file that matches `pattern` and was written after the time `began`."""
        found = sorted(self.out.glob(pattern), key=lambda file: file.stat().st_mtime)
        if not found or found[-1].stat().st_mtime < began - 2.0:  # clocks of file systems are coarse
            raise FileNotFoundError(f"{self.out / pattern}")
        return found[-1]

    def build(self, design: SensorDesign, done: Callable[[Path], None]) -> bool:
        """Make the whole bundle and pass its folder to `done`; returns False if another task is running."""
        folder = self.out / bundle_name(design)

        def finish() -> None:
            self._tell(Said(text=f"the bundle is ready: {folder}"))
            done(folder)

        return self._start("run", design, finish)

    def end(self) -> None:
        """End the running task; a later task reuses its finished parts."""
        with self._lock:
            self._is_ended = True
            process = self._process
        if process is not None and process.poll() is None:
            process.terminate()
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()

    def _start(self, verb: str, design: SensorDesign, finish: Callable[[], None]) -> bool:
        with self._lock:
            if self.is_running:
                return False
            self._is_ended = False
            holder = temporary_folder()
            file = Path(holder.name) / f"{design.name}.toml"
            save_design(design, file)
            self._process = started(["-m", "optopad", verb, str(file), "--out", str(self.out)])
        threading.Thread(
            target=self._follow,
            args=(verb, self._process, holder, finish),
            name=f"studio-{verb}",
            daemon=True,
        ).start()
        return True

    def _follow(
        self,
        verb: str,
        process: subprocess.Popen[str],
        holder: tempfile.TemporaryDirectory[str],
        finish: Callable[[], None],
    ) -> None:
        self._tell(Said(text=f"{verb}: started"))
        last = ""
        assert process.stderr is not None
        with holder, process.stderr:
            for line in process.stderr:
                if line.strip():
                    last = line.strip()
                    self._tell(Said(text=f"{verb}: {last.removeprefix('optopad: ')}"))
            code = process.wait()
        if self._is_ended:
            self._tell(Said(text=f"{verb}: ended; finished parts are reused"))
        elif code != 0:
            self._tell(
                Said(text=f"{verb}: {last.removeprefix('optopad: ') or f'ended with {code}'}", is_bad=True)
            )
        else:
            try:
                finish()
            except (
                OptopadError,
                OSError,
                LookupError,
                ValueError,
            ) as err:  # its files were moved or are damaged
                self._tell(Said(text=f"{verb}: its result cannot be read: {err}", is_bad=True))


def _found(count: int, folder: Path) -> str:
    if count == 0:
        return f"improve: no better design at score accuracy; see {folder}"
    return f"improve: {count} verified alternative{'s' if count > 1 else ''}, in {folder}"


class MoldShop:
    """Makes the printable mold of the newest design in a separate process; a newer design ends that process.

    Parameters
    ----------
    post : called on a separate thread with the design's digest, and with either the mesh in the cavity's coordinate
        system or the text of an error
    """

    def __init__(self, post: Callable[[str, Mesh | str], None]) -> None:
        self._post = post
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._digest = ""

    def want(self, design: SensorDesign) -> None:
        """Start making a design's mold, unless it is finished or in progress."""
        with self._lock:
            if design.digest == self._digest:
                return
            self._end()
            self._digest = design.digest
            holder = temporary_folder()
            file = Path(holder.name) / "design.toml"
            save_design(design, file)
            self._process = started(["-m", "optopad.cad", str(file), holder.name])
            arguments = (design, self._process, holder)
            threading.Thread(target=self._follow, args=arguments, name="studio-mold", daemon=True).start()

    def end(self) -> None:
        """End the running process."""
        with self._lock:
            self._end()
            self._digest = ""

    def _end(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.kill()

    def _follow(
        self, design: SensorDesign, process: subprocess.Popen[str], holder: tempfile.TemporaryDirectory[str]
    ) -> None:
        with holder:
            _, message = process.communicate()
            if process.returncode < 0:  # a newer design ended it
                return
            if process.returncode != 0:
                self._post(design.digest, message.strip().splitlines()[-1] if message.strip() else "no mold")
                return
            mesh = read_stl((Path(holder.name) / "mold.stl").read_bytes())
        lift = bed_lift_mm(design)
        moved = mesh.vertices.astype("float64") - [0.0, 0.0, lift]
        self._post(design.digest, Mesh(vertices=moved, triangles=mesh.triangles))
