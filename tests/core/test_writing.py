"""What is written appears whole or not at all; what a killed process left is removed, what another writes is not."""

import argparse
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from cases import each
from fg_mujoco.cli import main as cli
from fg_mujoco.course import writing
from fg_mujoco.course.writing import claimed_folder, require_writable, staged_folder, sweep, write_file, write_files
from fg_mujoco.errors import BagError

CODE = """
import sys
from pathlib import Path
from fg_mujoco.course.writing import claimed_folder, staged_file, staged_folder
"""


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def stopped(code, folder):
    """Start a process that runs some code and then waits, without end, in the midst of it."""
    process = subprocess.Popen(
        [sys.executable, "-c", CODE + code], cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "here\n"
    return process


def kill(process):
    process.kill()
    process.wait()
    process.stdin.close()
    process.stdout.close()


HERE = "print('here', flush=True); sys.stdin.read()"
WRITING = f"with staged_file('a.txt') as aside:\n  aside.write_text('torn'); {HERE}"
CLAIMING = f"with claimed_folder('run'):\n  {HERE}"
FILLING = (
    "with claimed_folder('run') as run, staged_folder(run, 'last') as aside:\n"
    "  for name in ('a', 'b', 'last'): (aside / name).write_text(name)\n"
)


@pytest.fixture
def full_disk(monkeypatch):
    def fill(call):
        def full(*_):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, call, full)

    return fill


def test_a_file_is_written_and_replaced(tmp_path):
    write_file(tmp_path / "a.txt", b"one")
    write_file(str(tmp_path / "a.txt"), lambda file: file.write(b"two"))
    assert (tmp_path / "a.txt").read_bytes() == b"two"
    assert names(tmp_path) == ["a.txt"]


def test_a_link_stays_and_what_it_points_to_is_written(tmp_path):
    (tmp_path / "to").mkdir()
    (tmp_path / "a.txt").symlink_to(tmp_path / "to" / "b.txt")
    for content in (b"new", b"other"):
        write_file(tmp_path / "a.txt", content)
        assert (tmp_path / "a.txt").is_symlink()
        assert (tmp_path / "to" / "b.txt").read_bytes() == content


@each("kind", ["folder", "fifo", "missing", "nul", "long"])
def test_what_is_no_place_for_a_file_is_refused_and_left_as_it_is(tmp_path, kind):
    path = tmp_path / {"missing": "no/a", "nul": "a\0", "long": "a" * 300}.get(kind, "a")
    if kind == "folder":
        path.mkdir()
    if kind == "fifo":
        os.mkfifo(path)
    before = names(tmp_path)
    for attempt in (lambda: write_file(path, b"x"), lambda: require_writable(path)):
        with pytest.raises(OSError) as refusal:
            attempt()
        assert refusal.value.strerror
        assert names(tmp_path) == before


@each("call", ["fsync", "replace"])
def test_a_full_disk_leaves_what_was_there(tmp_path, full_disk, call):
    (tmp_path / "a.txt").write_text("before")
    full_disk(call)
    with pytest.raises(OSError, match="No space left"):
        write_files({tmp_path / "b.txt": b"b", tmp_path / "a.txt": b"a"})
    assert names(tmp_path) == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "before"


def test_of_several_files_none_is_written_if_one_cannot_be(tmp_path):
    def fail(file):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        write_files({tmp_path / "a.txt": b"a", tmp_path / "b.txt": fail})
    assert names(tmp_path) == []


def test_a_file_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    calls = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda fd: (calls.append(os.fstat(fd).st_ino), fsync(fd)))
    monkeypatch.setattr(os, "replace", lambda path, to: (calls.append("moved"), replace(path, to)))
    write_file(tmp_path / "a.txt", b"a")
    file, folder = (tmp_path / "a.txt").stat().st_ino, tmp_path.stat().st_ino
    assert calls.index(file) < calls.index("moved") < calls.index(folder)


def test_what_a_killed_process_left_is_removed_by_the_next_write(tmp_path):
    (tmp_path / ".fg_mujoco-notes.partial").write_text("a user's own")
    process = stopped(WRITING, tmp_path)
    (left,) = (name for name in names(tmp_path) if name != ".fg_mujoco-notes.partial")
    kill(process)
    assert left in names(tmp_path)
    write_file(tmp_path / "b.txt", b"b")
    assert names(tmp_path) == [".fg_mujoco-notes.partial", "b.txt"]


def test_what_another_process_is_writing_is_left_to_it(tmp_path):
    process = stopped(WRITING, tmp_path)
    write_file(tmp_path / "a.txt", b"whole")
    assert len(names(tmp_path)) == 2
    assert (tmp_path / "a.txt").read_bytes() == b"whole"
    process.communicate("")
    assert process.returncode == 0
    assert (tmp_path / "a.txt").read_bytes() == b"torn"  # it was the last to write
    assert names(tmp_path) == ["a.txt"]


def test_many_threads_write_one_file_and_it_is_always_whole(tmp_path):
    contents = [bytes([i]) * 5000 for i in range(8)]
    threads = [
        threading.Thread(target=lambda c=c: [write_file(tmp_path / "a", c) for _ in range(20)]) for c in contents
    ]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        if (tmp_path / "a").exists():
            assert (tmp_path / "a").read_bytes() in contents
    assert names(tmp_path) == ["a"]


def test_a_folder_is_claimed_by_one_process_at_a_time(tmp_path):
    process = stopped(CLAIMING, tmp_path)
    with pytest.raises(OSError) as refusal, claimed_folder(tmp_path / "run"):
        pass
    assert refusal.value.strerror == "another process is writing to it"
    process.send_signal(signal.SIGKILL)
    process.wait()
    with claimed_folder(tmp_path / "run"):
        pass
    kill(process)


def test_a_claimed_folder_that_stays_empty_is_removed_with_those_made_for_it(tmp_path):
    with claimed_folder(tmp_path / "new" / "run"):
        assert (tmp_path / "new" / "run").is_dir()
    assert names(tmp_path) == []
    (tmp_path / "mine").mkdir()
    with claimed_folder(tmp_path / "mine" / "run") as run:
        write_file(run / "a", b"")
    with claimed_folder(tmp_path / "mine"):
        pass
    assert names(tmp_path / "mine") == ["run"]


@each("moved", range(4))
def test_a_folder_that_was_being_filled_is_empty_again_unless_all_was_moved(tmp_path, moved):
    """The process is killed when it has moved so many of its three files."""
    stop = (
        "import os\n"
        "replace, left = os.replace, [MOVED]\n"
        "def slow(path, to):\n"
        "  if Path(to).parent == Path('run'):\n"
        f"    if left[0] == 0: {HERE}\n"
        "    left[0] -= 1\n"
        "  replace(path, to)\n"
        "os.replace = slow\n"
        "if left[0] == 3:\n"
        "  from fg_mujoco.course import writing\n"
        f"  def stand(_): {HERE}\n"
        "  writing._remove_folder = stand\n"
    ).replace("MOVED", str(moved))
    process = stopped(stop + FILLING, tmp_path)
    kill(process)
    run = tmp_path / "run"
    assert len(names(run)) == moved + 1
    with claimed_folder(run):
        assert names(run) == (["a", "b", "last"] if moved == 3 else [])


def test_a_file_of_the_same_name_that_is_not_what_was_moved_is_left_alone(tmp_path):
    stop = (
        "import os\n"
        "replace = os.replace\n"
        "def slow(path, to):\n"
        "  replace(path, to)\n"
        f"  if Path(to) == Path('run/b'): {HERE}\n"
        "os.replace = slow\n"
    )
    process = stopped(stop + FILLING, tmp_path)
    kill(process)
    (tmp_path / "run" / "mine").write_text("mine")
    (tmp_path / "run" / "mine").replace(tmp_path / "run" / "b")
    with claimed_folder(tmp_path / "run") as run:
        assert names(run) == ["b"]


def test_without_locks_nothing_is_removed_and_nothing_is_refused(tmp_path, monkeypatch):
    kill(stopped(WRITING, tmp_path))
    monkeypatch.setattr(writing, "fcntl", None)
    (left,) = names(tmp_path)
    write_file(tmp_path / "a.txt", b"a")
    sweep(tmp_path)
    assert names(tmp_path) == sorted([left, "a.txt"])
    with claimed_folder(tmp_path) as folder, claimed_folder(folder), staged_folder(folder, "last") as aside:
        (aside / "last").write_text("")
    assert names(tmp_path) == sorted([left, "a.txt", "last"])


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    if os.geteuid() == 0:
        pytest.skip("root writes everywhere")
    Path(tmp_path / "run").mkdir(mode=0o500)
    for attempt in (write_file, require_writable):
        with pytest.raises(PermissionError):
            attempt(*((tmp_path / "run" / "a", b"a") if attempt is write_file else (tmp_path / "run" / "a",)))


def test_sigterm_ends_a_command_as_ctrl_c_does_and_leaves_no_temporary_folder(monkeypatch):
    made = []

    def run(options):
        with writing.temporary_folder("a thing") as folder:
            made.append(folder)
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(5.0)

    monkeypatch.setattr(cli._Parser, "parse_args", lambda *_: argparse.Namespace(run=run, command="bag"))
    before = signal.signal(signal.SIGTERM, signal.SIG_DFL)  # another test's library may have set one
    try:
        assert cli.main([]) == 143
        assert not made[0].exists() and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    finally:
        signal.signal(signal.SIGTERM, before)


def test_errors_name_what_is_made_in_a_temporary_folder():
    with pytest.raises(BagError) as error, writing.temporary_folder("the map") as folder:
        raise BagError(f"{folder}/b.yaml: cannot be written; accepted: a file that can be")
    assert str(error.value) == f"the map, in {folder.parent}: cannot be written; accepted: a file that can be"
