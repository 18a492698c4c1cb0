"""The folder of a rollout: complete chunks or none, gone on with by the same rollout only, read back bit for bit."""

import json
import shutil
import threading

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from comparison_worlds import files
from fg_mujoco.course.writing import claimed_folder
from fg_mujoco.errors import RunFolderError
from fg_mujoco.rollouts.chunk_store import MemoryStore, TemporaryFolderStore
from rollout_worlds import stand_in

ROLLOUT = {"track": ["oval", "tight"], "n": 21, "seed": 5, "executor": fg.Executor(chunk=4), "workers": 1, "laps": 2}
ROLLOUT["randomize"] = {"mu": (0.6, 1.2), "planner_mu": ["off", 1.0], "obstacles": "0:2"}


class Interrupting:
    """The stand-in, until it has driven some chunks."""

    def __init__(self, chunks):
        self.left, self.driven = chunks, 0
        self.lock = threading.Lock()

    def __call__(self, *args, **options):
        with self.lock:
            if self.left == 0:
                raise KeyboardInterrupt
            self.left -= 1
            self.driven += 1
        return stand_in(*args, **options)


@pytest.fixture
def engine(monkeypatch):
    """Put an engine in place that is interrupted after some chunks; it counts them."""

    def place(chunks=10**6):
        engine = Interrupting(chunks)
        monkeypatch.setattr("fg_mujoco.rollouts.job.drive_worlds", engine)
        return engine

    place()
    return place


def drive(**options):
    return fg.rollout(**(ROLLOUT | options))


def same(a, b):
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def refusal(*names, **options):
    with pytest.raises(RunFolderError) as caught:
        drive(**options)
    assert "\n" not in str(caught.value)
    for name in (*names, "accepted"):
        assert name in str(caught.value)


# -- what a folder holds


def test_a_finished_folder_has_all_that_is_promised(engine, tmp_path):
    result = drive(out=tmp_path / "runs" / "out")
    names = set(files(tmp_path / "runs" / "out"))
    chunks = {f"chunks/{number:06}.npz" for number in range(6)}
    assert names == {"manifest.json", "tracks.npz", "worlds.csv", "summary.json"} | chunks
    summary = json.loads((tmp_path / "runs/out/summary.json").read_text())
    assert summary["worlds_driven"] == 21
    assert summary["end_reasons"] == result.summary()["end_reasons"]
    rows = (tmp_path / "runs/out/worlds.csv").read_text().splitlines()
    assert len(rows) == 22
    manifest = json.loads((tmp_path / "runs/out/manifest.json").read_text())
    assert manifest["settings"]["randomize"] == {"mu": "0.6:1.2", "planner_mu": "inf|1.0", "obstacles": "0|1|2"}
    assert manifest["versions"]["mujoco_version"]


@each("record", ["summary", "telemetry", "states"])
def test_a_folder_reads_back_bit_for_bit(engine, tmp_path, record):
    kept = drive(record=record)
    drive(record=record, out=tmp_path / "out")
    shutil.move(tmp_path / "out", tmp_path / "elsewhere")
    read = fg.read_rollout(tmp_path / "elsewhere")
    assert same(read.worlds, kept.worlds)
    assert same(read.lap_times_s, kept.lap_times_s)
    for world in range(21):
        again, before = read.setup(world), kept.setup(world)
        assert same(again.track.centreline, before.track.centreline)
        assert again == before and again.first.seed == read["seed"][world]
        if record != "summary":
            assert same(read.telemetry(world), kept.telemetry(world))
        if record == "states":
            assert same(read.states(world), kept.states(world))
            assert same(read.ctrl(world), kept.ctrl(world))
            assert len(read.states(world)) == len(read.ctrl(world)) + 1


# -- budget


def test_what_fits_the_budget_stays_in_memory_and_the_rest_goes_to_a_folder_that_is_gone_with_it(engine):
    kept = drive(record="telemetry")
    assert isinstance(kept.chunks, MemoryStore)
    spilled = drive(record="telemetry", executor=fg.Executor(chunk=4, memory_budget=100_000))
    assert isinstance(spilled.chunks, TemporaryFolderStore)
    folder = spilled.chunks.folder
    assert list(folder.rglob("*.telemetry.npy"))
    assert isinstance(spilled.chunks.read(0)["telemetry"], np.memmap)
    assert all(same(kept.telemetry(world), spilled.telemetry(world)) for world in range(21))
    del spilled
    assert not folder.exists()


# -- going on


@pytest.mark.slow
@each("chunks", [0, 1, 4])
@each("record", ["summary", "states"])
def test_an_interrupted_rollout_is_gone_on_with_where_it_was(engine, tmp_path, chunks, record):
    whole = drive(record=record)
    engine(chunks)
    with pytest.raises(KeyboardInterrupt):
        drive(record=record, out=tmp_path / "out")
    assert len(list((tmp_path / "out/chunks").glob("*.npz"))) == chunks
    assert not (tmp_path / "out/summary.json").exists()
    with pytest.raises(RunFolderError, match="the same command finishes it"):
        fg.read_rollout(tmp_path / "out")

    seen = []
    rest = engine()
    result = drive(record=record, out=tmp_path / "out", watch=seen.append)
    assert rest.driven == 6 - chunks
    assert same(result.worlds, whole.worlds)
    assert result.worlds_driven == 21 - seen[0].worlds_found == seen[-1].worlds_driven
    if record == "states":
        assert all(same(result.states(world), whole.states(world)) for world in range(21))


def test_a_write_that_is_cut_off_leaves_no_chunk(engine, tmp_path, monkeypatch):
    def full(file, **arrays):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        engine(3)
        with pytest.raises(KeyboardInterrupt):
            drive(out=tmp_path / "out")
        engine()
        patch.setattr("numpy.savez", full)
        refusal("No space left on device", "out", out=tmp_path / "out")
    before = files(tmp_path / "out")
    assert len([name for name in before if name.endswith(".npz")]) == 4  # three chunks and the tracks
    assert not [name for name in before if "/." in name]
    assert same(drive(out=tmp_path / "out").worlds, drive().worlds)


# -- what is refused


@each(
    ("changed", "named"),
    [
        ({"n": 20}, "n is 21 there and 20 here"),
        ({"seed": 6}, "seed is 5 there and 6 here"),
        ({"seeds": range(21)}, "seed is 5 there and null here"),
        ({"laps": 3}, "laps is 2 there and 3 here"),
        ({"time_limit": 5.0}, "duration is null there and 5.0 here"),
        ({"record": "telemetry"}, 'record is "summary" there and "telemetry" here'),
        ({"track": ["tight", "oval"]}, "tracks is"),
        ({"randomize": {"mu": (0.6, 1.3)}}, "randomize is"),
    ],
)
def test_another_rollout_is_refused_and_nothing_is_changed(engine, tmp_path, changed, named):
    drive(out=tmp_path / "out")
    before = files(tmp_path / "out")
    refusal(named, "accepted: the same settings", out=tmp_path / "out", **changed)
    assert files(tmp_path / "out") == before


def test_a_folder_of_something_else_is_refused(engine, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    refusal("is not empty; accepted: a new or empty folder, or one of the same rollout", out=tmp_path)
    refusal("accepted: a new or empty folder", out=tmp_path / "notes.txt")
    refusal("accepted: a new or empty folder", out=tmp_path / "notes.txt" / "out")
    assert set(files(tmp_path)) == {"notes.txt"}
    with pytest.raises(RunFolderError, match=r"has no manifest.json"):
        fg.read_rollout(tmp_path)


@each("text", ["", "[]", '{"schema": 99}', "{"])
def test_a_damaged_manifest_is_refused(engine, tmp_path, text):
    drive(out=tmp_path / "out")
    (tmp_path / "out/manifest.json").write_text(text)
    refusal("manifest.json", out=tmp_path / "out")


def flip(path, place=0.5):
    content = bytearray(path.read_bytes())
    content[int(place * len(content))] ^= 1
    path.write_bytes(content)


def copy_over(folder, first, second):
    for path in list((folder / "chunks").glob(f"{second:06}.*")):
        path.unlink()
    for path in list((folder / "chunks").glob(f"{first:06}.*")):
        shutil.copy(path, path.with_name(path.name.replace(f"{first:06}", f"{second:06}")))


DAMAGE = {
    "cut": ("000003.npz", lambda f, _: (f / "chunks/000003.npz").write_bytes(b"PK")),
    "flipped": ("000003.npz", lambda f, _: flip(f / "chunks/000003.npz", 0.3)),
    "flipped trace": ("000003.npz", lambda f, _: flip(f / "chunks/000003.states.npy", 0.9)),
    "lost trace": ("000003.npz", lambda f, _: (f / "chunks/000003.ctrl.npy").unlink()),
    "another chunk": ("000003.npz", lambda f, _: copy_over(f, 1, 3)),
    "another's chunk": ("000003.npz", lambda f, g: shutil.copy(g / "chunks/000003.npz", f / "chunks/000003.npz")),
    "tracks": ("tracks.npz", lambda f, _: flip(f / "tracks.npz")),
}


@pytest.mark.slow
@each("damage", DAMAGE)
def test_a_damaged_file_is_refused_by_its_name_and_made_again_by_the_same_rollout(engine, tmp_path, damage):
    out, other = tmp_path / "out", tmp_path / "other"
    whole = drive(record="states", out=out)
    drive(record="states", seed=6, out=other)
    before = files(out)
    name, spoil = DAMAGE[damage]
    spoil(out, other)
    with pytest.raises(RunFolderError, match=rf"{name}: .*accepted: ") as caught:
        fg.read_rollout(out)
    assert "\n" not in str(caught.value)
    count = engine()
    with pytest.warns(UserWarning, match=rf"{name}: is damaged, and made again: ") as warned:
        again = drive(record="states", out=out)
    assert len(warned) == 1
    assert count.driven == (name != "tracks.npz")
    assert same(again.worlds, whole.worlds)
    assert files(out) == before


@each("name", ["worlds.csv", "summary.json"])
def test_an_edited_table_is_named_and_written_again(engine, tmp_path, name):
    drive(out=tmp_path / "out")
    worlds = (tmp_path / "out/worlds.csv").read_bytes()
    path = tmp_path / "out" / name
    path.write_text(path.read_text().replace("crash", "touch"))
    if name == "summary.json":
        with pytest.raises(RunFolderError, match=r"summary.json: ValueError: its sha256"):
            fg.read_rollout(tmp_path / "out")
    with pytest.warns(UserWarning, match=f"{name}: is damaged, and made again"):
        drive(out=tmp_path / "out")
    assert (tmp_path / "out/worlds.csv").read_bytes() == worlds
    assert "touch" not in path.read_text()
    assert fg.read_rollout(tmp_path / "out").summary()["end_reasons"]["crash"] > 0


def test_a_second_process_on_the_same_folder_is_refused(engine, tmp_path):
    with claimed_folder(tmp_path / "out"):
        refusal("another process is writing to it", out=tmp_path / "out")
    drive(out=tmp_path / "out")
