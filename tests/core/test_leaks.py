"""What is done again and again in one process leaves nothing behind: memory, descriptors and threads stay as they were.

The bounds are wide: the memory of a process goes up and down by some MiB by itself. benchmarks/leaks.py measures more.
"""

import gc
import json
import subprocess
import sys
import weakref
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

import fg_mujoco as fg
from cases import each

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "leaks.py"
MOST_KIB = 512.0  # per call; renderers once left 576 behind

if not Path("/proc/self/statm").exists():
    pytest.skip("memory is read from /proc, which is Linux's", allow_module_level=True)


@pytest.fixture(scope="module")
def leaks():
    sys.path.insert(0, str(SCRIPT.parent))
    spec = spec_from_file_location("leaks", SCRIPT)
    module = module_from_spec(spec)
    sys.modules["leaks"] = module
    spec.loader.exec_module(module)
    yield module
    sys.path.remove(str(SCRIPT.parent))
    del sys.modules["leaks"]


def is_flat(found):
    """Whether nothing grew: less than MOST_KIB a call, no descriptor, no thread."""
    return (
        found.kib_per_call < MOST_KIB
        and found.descriptors[1] <= found.descriptors[0]
        and found.threads[1] <= found.threads[0]
    )


def measured(leaks, name, share, warm=0.5):
    """What grew in a process of its own: those of the other tests are in this one.

    Memory that is taken once, as by a thread of Mesa that draws late, is no leak: a leak grows in each process. So
    growth is measured once more, up to three times, before it counts.
    """
    for _ in range(3):
        found = once_measured(leaks, name, share, warm)
        if is_flat(found):
            break
    return found


def once_measured(leaks, name, share, warm):
    command = [sys.executable, str(SCRIPT), "--only", name, "--share", str(share), "--warm", str(warm)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    if "need OpenGL" in done.stderr:
        pytest.skip("no EGL or OSMesa here: apt-get install libegl1 libgl1")
    assert done.returncode == 0, done.stderr
    return leaks.Growth(**json.loads(done.stdout.splitlines()[-1]))


@each(("name", "share"), (("races of four cars", 0.1), ("resets", 0.1)))
def test_what_is_done_again_and_again_leaves_nothing_behind(leaks, name, share):
    found = measured(leaks, name, share)
    assert is_flat(found), found


def test_a_race_that_failed_is_let_go_with_its_result():
    class Failing:
        def reset(self):
            pass

        def __call__(self, scan, odometry):
            raise ValueError("no")

    gc.collect()
    gc.disable()  # nothing but references
    try:
        with pytest.warns(UserWarning, match="ValueError: no"):
            result = fg.race("oval", Failing(), laps=1)
        world = weakref.ref(result.world)
        assert world() is not None
        del result
        assert world() is None
    finally:
        gc.enable()


def test_renderers_that_are_closed_leave_nothing_behind(leaks):
    found = measured(leaks, "renderers", 0.08, warm=0.75)  # Mesa's threads take memory at the first of them
    assert is_flat(found), found


LEAK = """
import json, sys
from dataclasses import asdict
from leaks import growth
kept = []
print(json.dumps(asdict(growth(lambda number: kept.append(b"x" * 2**20), 40))))  # 1 MiB a call
"""


def test_a_leak_of_memory_trips_the_guard(leaks):
    done = subprocess.run([sys.executable, "-c", LEAK], capture_output=True, text=True, cwd=SCRIPT.parent, check=True)
    found = leaks.Growth(**json.loads(done.stdout))
    assert not is_flat(found) and found.kib_per_call == pytest.approx(1024.0, rel=0.3)
