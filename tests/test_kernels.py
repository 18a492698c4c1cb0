"""Kernels give numpy's arithmetic, and are kept where their user may write."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from fg_mujoco.kernels import cache_folder, kernel

CODE = "from fg_mujoco.kernels import cache_folder; print(cache_folder())"


@kernel
def quotients(values, divisor, out):
    for i in range(len(values)):
        out[i] = values[i] / divisor


def folder_with(**environment):
    kept = {name: value for name, value in os.environ.items() if name not in ("XDG_CACHE_HOME", "HOME")}
    done = subprocess.run(
        [sys.executable, "-c", CODE], env=kept | environment, capture_output=True, text=True, check=True
    )
    return Path(done.stdout.strip())


def test_division_by_zero_is_numpys():
    values, out = np.array([1.0, -1.0, 0.0]), np.empty(3)
    quotients(values, 0.0, out)
    assert out[0] == np.inf and out[1] == -np.inf and np.isnan(out[2])


def test_threads_get_the_same_bits():
    values = np.random.default_rng(0).normal(size=10_000)
    outs = [np.empty_like(values) for _ in range(4)]
    threads = [threading.Thread(target=quotients, args=(values, 0.3, out)) for out in outs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({out.tobytes() for out in outs}) == 1
    assert outs[0].tobytes() == (values / 0.3).tobytes()


def test_kernels_are_kept_in_the_users_cache(tmp_path):
    folder = folder_with(XDG_CACHE_HOME=str(tmp_path / "cache"), HOME=str(tmp_path))
    assert folder.parent == tmp_path / "cache" / "fg_mujoco" and folder.is_dir()
    assert folder.name == cache_folder().name, "the name is of the sources alone"
    assert folder_with(HOME=str(tmp_path)).parent == tmp_path / ".cache" / "fg_mujoco"


def test_without_such_a_place_they_are_kept_in_a_new_folder_each_time(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    first, second = (folder_with(XDG_CACHE_HOME=str(blocked)) for _ in range(2))
    assert first != second and first.is_dir()


def test_decorating_leaves_the_cache_of_others_alone():
    import numba

    before = numba.config.CACHE_DIR
    kernel(lambda x: x)
    assert before == numba.config.CACHE_DIR


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals here")
def test_the_first_compilation_is_announced_on_a_terminal_and_nowhere_else(tmp_path):
    code = "from fg_mujoco.simulation.termination import end_reason; end_reason(False, False, 0, 1, 0.0, 0.0, 1.0)"
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    terminal, end = os.openpty()
    subprocess.run([sys.executable, "-c", code], env=environment, stderr=end, check=True)
    os.close(end)
    assert os.read(terminal, 1000).count(b"compiling, once") == 1
    piped = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True)
    assert piped.stderr == b""
    terminal, end = os.openpty()
    subprocess.run([sys.executable, "-c", f"{code}; import sys; sys.stderr.write('.')"], env=environment, stderr=end)
    os.close(end)
    assert os.read(terminal, 1000) == b".", "what is kept on disk is not compiled again"
