"""Kernels give numpy's arithmetic, and are kept where only their user may write, under names made of their sources."""

import errno
import hashlib
import os
import pickle
import pty
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.compiled.kernel_files import made_once
from fg_mujoco.compiled.kernels import cache_folder, kernel
from fg_mujoco.compiled.machine_code import machine
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from scan_worlds import CAR
from terminals import read_to_the_end

FOLDER = "from fg_mujoco.compiled.kernels import cache_folder; print(cache_folder())"
REASON = (
    "from fg_mujoco.simulation.termination import end_reason;"
    " print(end_reason(False, True, False, 0, 1, 0.0, 0.0, 0.0, 1.0))"
)
CRASH = "2\n"  # what REASON prints
ANNOUNCEMENT = "compiling kernels, which are kept for later: "


@kernel
def quotients(values, divisor, out):
    for i in range(len(values)):
        out[i] = values[i] / divisor


def run(code, *arguments, cwd=None, **environment):
    """Run a program with kernels kept where `environment` says, by a process that compiles first of all."""
    own = ("XDG_CACHE_HOME", "HOME", "FG_MUJOCO_COMPILING")
    kept = {name: value for name, value in os.environ.items() if name not in own}
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], env=kept | environment, capture_output=True, text=True, cwd=cwd
    )


@pytest.fixture
def cache(tmp_path, tmp_path_factory, monkeypatch):
    """An empty cache of this process, and an empty folder for what is temporary."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path_factory.mktemp("temporary")))
    monkeypatch.delenv("FG_MUJOCO_COMPILING", raising=False)
    cache_folder.cache_clear()
    yield tmp_path
    cache_folder.cache_clear()


def halve_anew():
    """Use a kernel as a new process would, and say whether it had to be compiled."""
    again, out = kernel(quotients.py_func), np.empty(2)
    again(np.array([1.0, 3.0]), 2.0, out)
    assert out.tolist() == [0.5, 1.5]
    return sum(again.stats.cache_misses.values()) == 1


def kept_in(cache):
    return sorted(file for file in (cache / "fg_mujoco" / "kernels").iterdir() if file.name != "locks")


def test_division_by_zero_is_numpys():
    values, out = np.array([1.0, -1.0, 0.0]), np.empty(3)
    quotients(values, 0.0, out)
    assert out[0] == np.inf and out[1] == -np.inf and np.isnan(out[2])


def test_what_is_kept_is_found_again(cache):
    assert cache_folder() == cache / "fg_mujoco" / "kernels"
    assert [halve_anew() for _ in range(3)] == [True, False, False]
    (file,) = kept_in(cache)
    assert file.name.startswith("quotients-")
    kernel(quotients.py_func)(np.ones(2), 2, np.empty(2))
    assert len(kept_in(cache)) == 2, "another signature"


def test_without_a_home_they_are_kept_in_the_temporary_folder(cache):
    (cache / "file").write_text("not a folder")
    (cache / "tmp").mkdir()
    nowhere = {"HOME": str(cache / "file"), "XDG_CACHE_HOME": str(cache / "file"), "TMPDIR": str(cache / "tmp")}
    folder = cache / "tmp" / f"fg_mujoco-{os.getuid()}" / "kernels"
    assert [run(FOLDER, **nowhere).stdout for _ in range(2)] == [f"{folder}\n"] * 2, "the next run finds them"
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.parent.chmod(0o777)
    said = run(FOLDER, **nowhere)
    assert not Path(said.stdout.strip()).exists() and "may write" in said.stderr, "a new one is gone with its process"
    assert [path.name for path in (cache / "tmp").iterdir()] == [folder.parent.name]


def test_a_home_or_a_cache_that_is_relative_is_ignored(cache):
    for name in ("tmp", "here"):
        (cache / name).mkdir()
    for given, folder in (
        ({"HOME": str(cache / "home"), "XDG_CACHE_HOME": "cache"}, cache / "home/.cache/fg_mujoco/kernels"),
        ({"HOME": "home"}, cache / f"tmp/fg_mujoco-{os.getuid()}/kernels"),
    ):
        assert run(FOLDER, TMPDIR=str(cache / "tmp"), cwd=cache / "here", **given).stdout == f"{folder}\n"
    assert list((cache / "here").iterdir()) == []


@pytest.mark.parametrize(("of", "mode"), [("fg_mujoco", 0o720), ("fg_mujoco/kernels", 0o702), ("fg_mujoco", None)])
def test_a_folder_that_others_may_write_to_is_not_used(cache, monkeypatch, capsys, of, mode):
    assert halve_anew()
    (file,) = kept_in(cache)
    file.write_bytes(b"not to be read")
    if mode:
        (cache / of).chmod(mode)
    else:
        true_stat = Path.stat

        def stat_of_another_user(path, **options):
            found = true_stat(path, **options)
            return os.stat_result([*found[:4], found[4] + (path == cache / of), *found[5:10]])  # st_uid

        monkeypatch.setattr(Path, "stat", stat_of_another_user)
    capsys.readouterr()
    cache_folder.cache_clear()
    assert halve_anew()
    warning = f"fg_mujoco: other users may write to {cache / of}: compiled kernels are not kept there\n"
    assert capsys.readouterr().err == warning
    assert cache not in cache_folder().parents and cache_folder().stat().st_mode & 0o777 == 0o700
    assert [path.read_bytes() for path in kept_in(cache)] == [b"not to be read"]


def test_a_damaged_file_is_compiled_anew_and_replaced(cache):
    assert halve_anew()
    (file,) = kept_in(cache)
    whole = file.read_bytes()
    wrong = bytearray(whole)
    wrong[len(whole) // 2] ^= 1
    other = pickle.dumps(("not", "what", "was", "compiled"))
    unexpected = hashlib.sha256(other).digest() + other
    for damaged in (b"", b"\x80\x04garbage" * 50, whole[:-1], bytes(wrong), unexpected):
        file.write_bytes(damaged)
        assert halve_anew() and not halve_anew(), damaged[:20]
        assert kept_in(cache) == [file], "nothing unfinished is left"
    file.unlink()
    file.mkdir()
    assert halve_anew() and halve_anew()


def test_another_processor_has_files_of_its_own(cache, monkeypatch):
    """A home folder may be shared by machines."""
    import llvmlite.binding as llvm

    assert halve_anew()
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(llvm, "get_host_cpu_name", lambda: "another")
        machine.cache_clear()
        assert halve_anew() and not halve_anew() and len(kept_in(cache)) == 2
    machine.cache_clear()
    assert not halve_anew()


@each("failing", ["write_bytes", "replace", "read_bytes"])
def test_where_nothing_can_be_written_or_read_kernels_are_compiled(cache, monkeypatch, failing):
    cache_folder.cache_clear()
    def fail(path, *_):
        if failing == "write_bytes":
            path.touch()  # a part of it
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    if failing == "read_bytes":
        assert halve_anew()
    monkeypatch.setattr(Path, failing, fail)
    assert halve_anew() and halve_anew()
    assert failing == "read_bytes" or kept_in(cache) == []


WAITS = """
import sys
from pathlib import Path
from fg_mujoco.compiled.kernel_files import made_once
file = Path(sys.argv[1])
print("starts", flush=True)
with made_once(file, patience=float(sys.argv[2])):
    print(file.exists())
"""


@each(("patience", "found"), [(60.0, True), (0.1, False)])
def test_a_process_waits_for_what_another_one_makes(tmp_path, patience, found):
    file = tmp_path / "tick-0123456789abcdef"
    command = [sys.executable, "-c", WAITS, str(file), str(patience)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        with made_once(file):
            assert other.stdout.readline() == "starts\n"
            with made_once(file.with_name("step-fedcba9876543210")):  # the end of another lock does not free this one
                time.sleep(0.2)
            if found:
                file.touch()
            else:
                assert other.stdout.readline() == "False\n"
        if found:
            assert other.stdout.readline() == "True\n"


CALLS = """
import numba
from fg_mujoco.compiled.kernels import inlined, kernel
@kernel
def refuses(x):
    if x > 1.0:
        raise ValueError("too large", x)
    return x
@kernel
def passes_on(x):
    return refuses(x) + 1.0
@kernel
def prints(x):
    print("x is", x)
    return x
@kernel
def through(function, x):
    return function(x) + prints(x)
@kernel
def to(exponent, x):
    return x ** numba.literally(exponent)
@kernel
def cube(x):
    return to(3, x)
@kernel
def fibonacci(n):
    return n if n < 2 else fibonacci(n - 1) + fibonacci(n - 2)
@kernel
def next_fibonacci(n):
    return fibonacci(n + 1)
@kernel
def even(n):
    return True if n == 0 else odd(n - 1)
@kernel
def odd(n):
    return False if n == 0 else even(n - 1)
@inlined
def half(x):
    return 0.5 * x
@kernel
def quarter(x, y=0.0):
    return half(half(x)) + y
@kernel
def quarters(x):
    return quarter(x) + quarter(x, 1.0) + quarter(x, y=2.0)
@numba.njit
def of_others(x):
    return passes_on(x)
@kernel
def through_others(x):
    return of_others(x) + refuses(x)
def answer(function, *arguments):
    try:
        return function(*arguments)
    except ValueError as error:
        return error.args
for function, *arguments in (
    (passes_on, 0.5), (passes_on, 2.0), (through, quarter, 4.0), (through, refuses, 3.0), (cube, 2.0), (fibonacci, 10),
    (next_fibonacci, 10), (even, 7), (odd, 7), (quarters, 4.0), (of_others, 2.0), (through_others, 0.5),
    (through_others, 3.0),
):
    print(answer(function, *arguments))
"""
ANSWERS = """1.5
('too large', 2.0)
x is 4.0
5.0
('too large', 3.0)
8.0
55
89
False
True
6.0
('too large', 2.0)
2.0
('too large', 3.0)
"""


def test_kernels_that_call_each_other_answer_as_python_does_compiled_and_from_disk(tmp_path):
    program = tmp_path / "calls.py"
    program.write_text(CALLS)
    code = f"import runpy; runpy.run_path({str(program)!r})"
    kept = []
    for _ in range(2):  # compiled, then from disk, but for what cannot be kept
        done = run(code, XDG_CACHE_HOME=str(tmp_path))
        assert (done.returncode, done.stdout) == (0, ANSWERS), done.stderr
        kept.append(kept_in(tmp_path))
    assert kept[0] == kept[1]
    names = {file.name.rpartition("-")[0] for file in kept[0]}
    assert {"passes_on", "refuses", "quarters", "quarter", "fibonacci"} <= names
    assert not names & {"even", "odd"}, "machine code that calls each other's addresses"


MADE = """
import sys
from fg_mujoco.compiled.kernels import kernel
def made(number):
    @kernel
    def adds(x):
        return x + number
    return adds
one, twenty = made(1.0), made(20.0)
@kernel
def first(x):
    return one(x)
@kernel
def second(x):
    return twenty(x)
@kernel
def both(x):
    return one(x) + 100.0 * twenty(x)
print(globals()[sys.argv[1]](0.0))
"""


def test_functions_of_one_name_are_told_apart_whatever_processes_compiled_them(tmp_path):
    """Numba numbers functions from 1 on in each process, and code is linked by names that have these numbers."""
    (tmp_path / "made.py").write_text(MADE)
    for name, answer in (("first", 1.0), ("second", 20.0), ("both", 2001.0)):
        code = f"import runpy, sys; sys.argv[1:] = [{name!r}]; runpy.run_path({str(tmp_path / 'made.py')!r})"
        done = run(code, XDG_CACHE_HOME=str(tmp_path))
        assert (done.returncode, done.stdout) == (0, f"{answer}\n"), done.stderr


def signatures():
    """What each kernel of the package has been compiled for."""
    modules = [module for name, module in sorted(sys.modules.items()) if name.split(".")[0] == "fg_mujoco"]
    kernels = {id(value): value for module in modules for value in vars(module).values() if hasattr(value, "py_func")}
    return {(found.__module__, found.__qualname__): set(found.signatures) for found in kernels.values()}


class Commander:
    """Limits a command by the friction limiter and answers it, in one kind of numbers."""

    def __init__(self, number):
        self.number, self.limiter = number, FrictionLimiter(CAR, 1.0)

    def reset(self):
        self.limiter.reset()

    def __call__(self, scan, odometry):
        self.limiter(self.number(0), self.number(2), odometry, scan.scan_time)
        return fg.DriveCommand(steering_angle=self.number(0), speed=self.number(2))


def command_everywhere(number):
    """Command a car in a race, in a simulation and by hand."""
    result = fg.race("oval", Commander(number), laps=1, time_limit=0.1)
    command = fg.DriveCommand(steering_angle=number(0), speed=number(2))
    simulation = fg.Simulation(fg.World("oval"))
    simulation.step(command)
    simulation.drive(number(0), number(2))
    simulation.world.car.apply(simulation.data, command)
    return result.trajectory_sha256


def test_a_command_in_other_numbers_compiles_nothing_anew():
    bits, before = command_everywhere(float), signatures()
    assert any("drive" in name and compiled for (_, name), compiled in before.items())
    assert command_everywhere(int) == command_everywhere(np.float32) == bits
    assert signatures() == before


TWO_PROCESSES = (
    f"import subprocess, sys; {REASON}; from fg_mujoco.controllers.control.steering import saturate;"
    "saturate(1.0, 2.0);"
    "subprocess.run([sys.executable, '-c', 'from fg_mujoco.controllers.control.speed import friction_steering as f;"
    "f(1.0, 1.0, 1.0, 9.81)'], check=True)"
)


def test_what_is_compiled_is_named_on_a_terminal_and_not_in_a_pipe(tmp_path):
    """Nor by processes that the first one starts, nor where all is on disk. The line is gone in the end."""
    done = run(TWO_PROCESSES, XDG_CACHE_HOME=str(tmp_path / "piped"))
    assert (done.returncode, done.stdout, done.stderr) == (0, CRASH, "")
    shown = []
    for _ in range(2):
        ours, theirs = pty.openpty()
        kept = {name: value for name, value in os.environ.items() if name != "FG_MUJOCO_COMPILING"}
        own = kept | {"XDG_CACHE_HOME": str(tmp_path / "shown")}
        with subprocess.Popen([sys.executable, "-c", TWO_PROCESSES], env=own, stdout=theirs, stderr=theirs) as process:
            os.close(theirs)
            shown.append(read_to_the_end(ours).decode())
        assert process.returncode == 0
    named = [text for text in shown[0].split("\r\x1b[K") if ANNOUNCEMENT in text]
    assert ["end_reason" in text for text in named] == [True, False] and "saturate" in named[1]
    assert "number 1, " in named[0] and "number 2, " in named[1] and " s so far" in named[1]
    assert ANNOUNCEMENT not in shown[1]


BESIDE = """
import time
from pathlib import Path
from fg_mujoco.compiled.beside import beside
from fg_mujoco.compiled.kernels import cache_folder, kernel
from fg_mujoco.controllers.control.speed import share_of_way
@kernel
def sum_of(a, b):
    return a + b
with beside(share_of_way, 0.1, 0.2):  # a kernel: the other process compiles it
    print(any(cache_folder().glob("share_of_way-*")))
    sum_of(1, 2)
    end = time.monotonic() + 60.0
    while not any(cache_folder().glob("share_of_way-*")) and time.monotonic() < end:
        time.sleep(0.02)
    print(any(cache_folder().glob("share_of_way-*")))
"""


def test_another_process_compiles_what_it_was_asked_for_once_a_kernel_is_compiled_here(tmp_path):
    """The program is a file: the other process does not run it again."""
    program = tmp_path / "program.py"
    program.write_text(BESIDE)
    done = run(f"import runpy; runpy.run_path({str(program)!r}, run_name='__main__')", XDG_CACHE_HOME=str(tmp_path))
    assert (done.stdout, done.returncode) == ("False\nTrue\n", 0), done.stderr
    assert done.stderr == ""
