"""Ctrl-C at any moment: one short message and exit code 130, or the outcome that is known already."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from numba import njit

from optopad.screen.output import progress
from optopad.sims.compiling import compiling_told, is_there, listen_to_numba, tell_of

ROOT = Path(__file__).parents[2]
TOLD = "optopad: interrupted: no file is incomplete, and finished parts are reused\n"

WHILE_VERBS_ARE_LOADED = """
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "typer":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupting())
"""
WHERE_PYTHON_DROPS_IT = """
class Dropping:
    def __del__(self):
        raise KeyboardInterrupt
def examine():
    Dropping()
    time.sleep(10)
import optopad.doctor
optopad.doctor.examine = examine
"""
WHILE_A_PACKAGE_IS_LOADED = """
import importlib.util
class Half:  # a compiled package: what cuts its loading short is a failure of its own
    def find_spec(self, name, path=None, target=None):
        return importlib.util.spec_from_loader(name, self) if name == "half" else None
    def create_module(self, spec):
        return None
    def exec_module(self, module):
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.1)
        except KeyboardInterrupt:
            raise ImportError("initialization failed")
sys.meta_path.insert(0, Half())
def examine():
    import half
    time.sleep(3)
    os._exit(0)
import optopad.doctor
optopad.doctor.examine = examine
"""
WITHOUT_IT = WHILE_A_PACKAGE_IS_LOADED.replace('raise ImportError("initialization failed")', "pass")
TOO_LONG = "import optopad.cli.interrupts as ours\nours.LONGEST_IMPORT_S = 0.0" + WHILE_A_PACKAGE_IS_LOADED
WHERE_A_PACKAGE_CALLS_BACK = """
def examine():
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.1)
    except KeyboardInterrupt:
        raise ValueError("invalid bounding box")
import optopad.doctor
optopad.doctor.examine = examine
"""
WHERE_TEXT_IS_EXECUTED = """
def examine():
    exec("raise KeyboardInterrupt")  # Python takes it for unhandled, and kills itself at its end
import optopad.doctor
optopad.doctor.examine = examine
"""
WHERE_NOBODY_READS_ANY_MORE = """
def examine():
    reading, writing = os.pipe()
    sys.stdout = os.fdopen(writing, "w")
    print("half a table")
    os.close(reading)
    raise KeyboardInterrupt
import optopad.doctor
optopad.doctor.examine = examine
"""
BY_KILL = """
def examine():
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(10)
import optopad.doctor
optopad.doctor.examine = examine
"""
BY_HANGING_UP = (
    BY_KILL.replace("SIGTERM", "SIGHUP")
    + "signal.signal(signal.SIGHUP, signal.SIG_DFL)  # tests may run by nohup\n"
)
TWICE = """
class Interrupting:
    def write(self, text):
        os.kill(os.getpid(), signal.SIGINT)
        return sys.__stderr__.write(text)
    def flush(self):
        sys.__stderr__.flush()
def examine():
    sys.stderr = Interrupting()
    raise KeyboardInterrupt
import optopad.doctor
optopad.doctor.examine = examine
"""
AFTER_A_CLEAN_END = """
from optopad.verbs.driver.read import until_interrupted
def examine():
    with until_interrupted():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(10)
    raise ValueError
import optopad.doctor
optopad.doctor.examine = examine
"""
COMPILED = """
import hashlib, threading
from pathlib import Path
import optopad.doctor
def compiled(rounds):
    hashlib.pbkdf2_hmac("sha1", b"", b"", rounds)  # lets other threads run, and looks at no signal
def within(file, rounds):
    names = {"compiled": compiled}
    exec(compile(f"def work(): compiled({rounds})", str(Path.cwd() / file), "exec"), names)
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
    names["work"]()
"""
IN_COMPILED_CODE = (
    COMPILED
    + """
def examine():
    from optopad.design.preset import preset
    from optopad.fabrication.bundle import bundle
    from optopad.work import started
    child = started(["-c", "import time; time.sleep(60)"])
    with bundle(preset("fingertip-16"), Path(os.environ["OUT"]), seed=0):
        print(child.pid, len(os.listdir(os.environ["OUT"])), flush=True)
        within("optopad/sims/contact/any.py", 10**9)
optopad.doctor.examine = examine
"""
)
WHERE_A_STAGE_MOVES = (
    COMPILED
    + """
import optopad.cli.interrupts as ours
ours.PATIENCE_S = 0.1
def examine():
    try:
        within("optopad/fabrication/stage/any.py", 2 * 10**6)
    finally:
        print("the tip is up", flush=True)
optopad.doctor.examine = examine
"""
)
WHERE_THREADS_ARE_WAITED_FOR = (
    COMPILED
    + """
from concurrent.futures import ThreadPoolExecutor
def examine():
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
    with ThreadPoolExecutor(max_workers=2) as pool:
        list(pool.map(compiled, [10**9] * 4))
optopad.doctor.examine = examine
"""
)
WHEN_ALL_IS_DONE = "atexit.register(os.kill, os.getpid(), signal.SIGINT)\n"


def command(before: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The installed command in a process of its own, after some code."""
    program = (
        f"import atexit, os, signal, sys, time\n{before}\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # the tests may run with Ctrl-C ignored
        f"sys.argv = ['optopad', *{arguments!r}]\nfrom optopad.cli import main\nmain()"
    )
    return subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )


@pytest.mark.parametrize(
    "before",
    [
        pytest.param(WHILE_VERBS_ARE_LOADED, id="while the verbs are loaded"),
        pytest.param(WHERE_PYTHON_DROPS_IT, id="in a destructor, where Python drops it"),
        pytest.param(WHILE_A_PACKAGE_IS_LOADED, id="while a package is loaded", marks=pytest.mark.slow),
        pytest.param(
            WITHOUT_IT, id="while a package is loaded that others do without", marks=pytest.mark.slow
        ),
        pytest.param(TOO_LONG, id="while a package is loaded that takes too long", marks=pytest.mark.slow),
        pytest.param(WHERE_A_PACKAGE_CALLS_BACK, id="where a package calls back", marks=pytest.mark.slow),
        pytest.param(WHERE_NOBODY_READS_ANY_MORE, id="where nobody reads any more"),
        pytest.param(BY_KILL, id="by kill"),
        pytest.param(BY_HANGING_UP, id="by hanging up", marks=pytest.mark.slow),
        pytest.param(TWICE, id="twice", marks=pytest.mark.slow),
        pytest.param(WHERE_TEXT_IS_EXECUTED, id="where text is executed", marks=pytest.mark.slow),
    ],
)
def test_ctrl_c_ends_a_command_with_one_message(before: str) -> None:
    done = command(before, "doctor", "--json")
    assert (done.returncode, done.stdout, done.stderr) == (130, "", TOLD)


def test_a_failure_after_a_clean_end_is_told() -> None:
    done = command(AFTER_A_CLEAN_END, "doctor", "--json")
    assert done.returncode == 1
    assert "optopad's own failure" in done.stderr


def test_ctrl_c_after_the_work_changes_nothing() -> None:
    done = command(WHEN_ALL_IS_DONE, "schema")
    assert (done.returncode, done.stderr) == (0, "")


def test_ctrl_c_ends_compiled_code_with_what_the_command_began(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OUT", str(tmp_path))
    done = command(IN_COMPILED_CODE, "doctor", "--json")
    assert (done.returncode, done.stderr) == (130, TOLD)
    child, folders = map(int, done.stdout.split())
    assert folders == 1
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


def test_ctrl_c_lets_what_is_no_computation_end_its_blocks() -> None:
    done = command(WHERE_A_STAGE_MOVES, "doctor", "--json")
    assert (done.returncode, done.stdout, done.stderr) == (130, "the tip is up\n", TOLD)


@pytest.mark.slow
def test_ctrl_c_does_not_wait_for_threads() -> None:
    done = command(WHERE_THREADS_ARE_WAITED_FOR, "doctor", "--json")
    assert (done.returncode, done.stdout, done.stderr) == (130, "", TOLD)


LINE = "compiling the light kernels, once on this machine: half a minute or more"


def kernel_under(name: str):
    """A kernel nobody has compiled yet, under the name of an entry point."""

    def trace_further(x):
        return x + 1

    trace_further.__name__ = name
    tell_of("flat_matrix")
    return njit(trace_further)


def test_compiling_is_told_when_it_begins_and_when_the_last_entry_point_is_done() -> None:
    listen_to_numba()
    told: list[float] = []
    helper, small, last = map(kernel_under, ("a_helper", "flat_matrix", "trace_further"))
    with compiling_told(told.append):
        helper(1)
        assert told == []  # compiled in no time
        small(1)
        assert told == [0.0]
        last(1)
        assert told == [0.0, 1.0]
        last(2)
        small(3)
    assert told == [0.0, 1.0]
    kernel_under("trace_further")(1)
    assert told == [0.0, 1.0]


def test_a_kernel_that_another_process_compiled_is_the_end_of_it() -> None:
    told: list[float] = []
    with compiling_told(told.append):
        is_there("flat_matrix")
        is_there("trace_further")
        assert told == []
        kernel_under("flat_matrix")(1)
        is_there("trace_further")
    assert told == [0.0, 1.0]


def test_compiling_that_is_cut_short_is_told_to_be_over() -> None:
    listen_to_numba()
    told: list[float] = []

    def cut_short() -> None:
        with compiling_told(told.append):
            kernel_under("flat_matrix")(1)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cut_short()
    assert told == [0.0, 1.0]


def test_machines_read_nothing_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    listen_to_numba()
    with progress(quiet=True):
        kernel_under("trace_further")(1)
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "")


def test_drawing_progress_needs_no_numba() -> None:
    program = (
        "import sys\nfrom optopad.screen.output import progress\n"
        "with progress(quiet=False) as step:\n    step('mold', 1.0)\n"
        "print('numba' in sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "False"
    assert LINE not in result.stderr
