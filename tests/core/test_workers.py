"""Items of work in processes: each is answered or named, and no worker outlives the process that started it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from fg_mujoco.rollouts.workers import work_off


def fare(item):
    """What a worker does: it returns, fails, leaves, dies or sleeps."""
    how, number = item
    if how == "fails":
        raise ValueError(f"no\n{number}")
    if how == "leaves":
        sys.exit(number)
    if how == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "sleeps":
        Path(f"{os.getpid()}.pid").touch()
        time.sleep(number)
    return number


def answers(*items, **options):
    return list(work_off(fare, items, workers=2, pulse=lambda: None, **options))


def test_an_item_whose_worker_dies_is_answered_and_the_others_are_done():
    items = [("returns", 1), ("dies", 2), ("returns", 3), ("leaves", 4), ("returns", 5), ("dies", 6)]
    found = answers(*items, died=lambda item, how: how)
    assert dict(found) == {
        item: {
            "returns": item[1], "dies": "the worker ended by SIGKILL", "leaves": "the worker ended with exit code 4",
        }[item[0]]
        for item in items
    }  # fmt: skip


def test_workers_end_with_the_process_that_started_them(tmp_path):
    code = (
        "from test_workers import answers\n"
        "if __name__ == '__main__':\n"
        "    answers(('sleeps', 1000), ('sleeps', 1001))\n"
    )
    (tmp_path / "script.py").write_text(code)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    process = subprocess.Popen([sys.executable, "script.py"], cwd=tmp_path, env=environment, stderr=subprocess.PIPE)
    until = time.monotonic() + 60
    while len(list(tmp_path.glob("*.pid"))) < 2 and time.monotonic() < until:
        time.sleep(0.05)
    process.kill()
    workers = [int(path.stem) for path in tmp_path.glob("*.pid")]
    assert len(workers) == 2
    process.communicate(timeout=30)  # ends when the last worker has let go of its standard error


def test_a_script_that_starts_processes_as_it_is_imported_is_told(tmp_path):
    (tmp_path / "script.py").write_text("from test_workers import answers\nanswers(('returns', 1), ('returns', 2))\n")
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    run = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60
    )
    errors = [line for line in run.stderr.splitlines() if line.startswith("fg_mujoco.errors.EngineError")]
    assert "before it began; accepted: a script that calls this under `if __name__" in errors[-1]
    # after it, Python may warn of semaphores: of the other worker, when it is ended while it imports the script
