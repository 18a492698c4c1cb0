"""Run folders that are damaged or of another version: each is refused in one line that names what is wrong in it."""

import io
import json
import re
import shutil
import zipfile

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from conftest import plain_runs
from fg_mujoco.cli.main import main
from fg_mujoco.racing.run_folder import read_summary
from forging import without_checksums
from refusals import refused
from vehicle_worlds import made_file

DOORS = {
    "replay": ("replay", "run"),
    "report": ("report", "run"),
    "render": ("render", "run", "--frame", "0", "--size", "64x48", "--quality", "draft", "--out", "picture.png"),
    "export": ("export", "run", "--out", "bag.mcap"),
}
EXTRAS = {"report": "bokeh", "render": "PIL", "export": "mcap"}
FILES = ("states.npz", "telemetry.csv", "summary.json", "scene.xml")


@pytest.fixture(scope="module")
def raced(tmp_path_factory):
    """A run of twelve ticks, as `race --out` writes it."""
    folder = tmp_path_factory.mktemp("raced") / "run"
    with plain_runs():
        main(["race", "--laps", "1", "--time-limit", "0.3", "--out", str(folder)])
    return folder


@pytest.fixture
def whole(raced, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(raced, tmp_path / "run")
    return tmp_path


@pytest.fixture
def here(whole):
    """The run without its checksums, so that what is read is checked for itself."""
    without_checksums(whole / "run")
    return whole


def states(here, **members):
    """Write other members into states.npz; None leaves one out."""
    path = here / "run/states.npz"
    with np.load(path) as file:
        written = {name: file[name] for name in ("time", "state", "ctrl")} | members
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in written.items():
            if array is not None:
                buffer = io.BytesIO()
                np.save(buffer, array)
                archive.writestr(f"{name}.npy", buffer.getvalue())


def state_with(value):
    """Return what sets a number of a state."""

    def spoil(here):
        with np.load(here / "run/states.npz") as file:
            array = file["state"].copy()
        array[5, 7] = value
        states(here, state=array)

    return spoil


def text_of(name, change):
    """Return what changes the text of a file of the run."""

    def spoil(here):
        path = here / "run" / name
        path.write_text(change(path.read_text("utf-8")), "utf-8")

    return spoil


def cell(value):
    """Return what writes into a cell of telemetry.csv."""

    def change(text):
        lines = text.splitlines()
        row = lines[4].split(",")
        lines[4] = ",".join([*row[:3], value, *row[4:]])
        return "\n".join(lines) + "\n"

    return text_of("telemetry.csv", change)


def summary(**changes):
    """Return what changes values of the summary."""
    return text_of("summary.json", lambda text: json.dumps(json.loads(text) | changes))


DAMAGED = {
    ("states.npz", "texts"): (lambda h: states(h, time=np.full(13, "a" * 8)), "of <U8"),
    ("states.npz", "objects"): (lambda h: states(h, state=np.array([{}], dtype=object)), "Object arrays|of object"),
    ("states.npz", "whole numbers"): (lambda h: states(h, time=np.arange(13)), "int64"),
    ("states.npz", "NaN"): (state_with(np.nan), "state has a number that is none"),
    ("states.npz", "beyond"): (state_with(1e300), "beyond 1e"),
    ("states.npz", "rows"): (lambda h: states(h, ctrl=np.zeros((50, 2))), r"shapes \(13,\)"),
    ("states.npz", "columns"): (lambda h: states(h, ctrl=np.zeros((12, 3))), r"\(12, 3\)"),
    ("states.npz", "no state"): (lambda h: states(h, state=None), "it has not the arrays time, state, ctrl"),
    ("states.npz", "one more"): (lambda h: states(h, more=np.zeros(1)), "and no others"),
    ("states.npz", "empty"): (lambda h: (h / "run/states.npz").write_bytes(b""), "EOFError"),
    ("states.npz", "time stands"): (lambda h: states(h, time=np.zeros(13)), "time does not grow"),
    ("telemetry.csv", "columns"): (text_of("telemetry.csv", lambda text: text[5:]), "columns "),
    ("telemetry.csv", "torn"): (text_of("telemetry.csv", lambda text: text[:-5]), "line 13 is torn"),
    ("telemetry.csv", "a word"): (cell("fast"), "could not convert"),
    ("telemetry.csv", "NaN"): (cell("nan"), "a number that is none"),
    ("telemetry.csv", "bytes"): (lambda h: (h / "run/telemetry.csv").write_bytes(b"\xff" * 100), "columns "),
    ("summary.json", "torn"): (text_of("summary.json", lambda text: text[:-5]), "is no JSON"),
    ("summary.json", "another version"): (summary(schema=2), "is no JSON object with schema 1"),
    ("summary.json", "NaN"): (summary(mu=float("nan")), "mu is nan"),
    ("summary.json", "an end that is a text"): (summary(cars=[{"end_time_s": ""}]), "cars is "),
    ("summary.json", "laps"): (summary(laps_requested=10**9), "accepted: a whole number from 0 to 1000"),
    ("scene.xml", "text"): (text_of("scene.xml", lambda xml: "hello"), "no XML"),
    ("scene.xml", "nothing in it"): (text_of("scene.xml", lambda xml: "<mujoco/>"), "car/"),
    ("scene.xml", "another timestep"): (text_of("scene.xml", lambda xml: xml.replace("0.005", "0.007", 1)),
                                        "a whole fraction"),
    ("scene.xml", "another car"): (text_of("scene.xml", lambda xml: xml.replace('name="car/chassis"', 'name="car/x"')),
                                   "chassis"),
    ("scene.xml", "a file"): (text_of("scene.xml", lambda xml: xml.replace("</mujoco>",
                              '<asset><mesh name="a" file="/etc/passwd"/></asset></mujoco>')), "names a file"),
    ("scene.xml", "an include"): (text_of("scene.xml", lambda xml: xml.replace("</mujoco>",
                                  '<include file="/etc/passwd"/></mujoco>')), "<include>"),
    ("scene.xml", "a look beside"): (text_of("scene.xml", lambda xml: xml.replace('"f1tenth_look.xml"',
                                     '"../evil.xml"')), "text 'car/look' is"),
}  # fmt: skip


def pick(door):
    """Skip what needs an extra that is not here."""
    if door in EXTRAS:
        pytest.importorskip(EXTRAS[door], reason=f"no {EXTRAS[door]} here")
    return DOORS[door]


@each(("file", "name"), DAMAGED)
def test_a_damaged_folder_is_refused_in_one_line(file, name, here, capsys):
    spoil, said = DAMAGED[file, name]
    spoil(here)
    err = refused(here, capsys, "replay", "run")
    assert err.startswith(f"fg-mujoco: run/{file}: ") and re.search(said, err) and len(err) < 500
    with pytest.raises(fg.RunFolderError):
        fg.replay("run")


@each("file", FILES)
def test_a_file_that_is_missing_or_edited_is_named(file, whole, capsys):
    with (whole / "run" / file).open("ab") as opened:
        opened.write(b"\n]")
    assert f"run/{file}: " in refused(whole, capsys, "replay", "run")
    (whole / "run" / file).unlink()
    assert file in refused(whole, capsys, "replay", "run")


@each("door", ["report", "render", "export"])
@each(("file", "name"), [(file, next(name for of, name in DAMAGED if of == file)) for file in FILES])
def test_every_door_refuses_them(door, file, name, here, capsys):
    arguments = pick(door)
    DAMAGED[file, name][0](here)
    err = refused(here, capsys, *arguments)
    assert err.startswith(f"fg-mujoco: run/{file}: ") and len(err) < 500


WRONG = (-1, 1.5, "a" * 5000, True, [], [None], {}, {"a": {}}, 10**400)


@each("door", ["replay", "export", "race"])
def test_no_value_of_a_summary_ends_in_a_traceback(door, here, capsys, monkeypatch):
    """Whatever a value is, a door answers, or refuses it in one line."""
    arguments = ("race", "--config", "run", "--time-limit", "0.05", "--json") if door == "race" else pick(door)
    path = here / "run/summary.json"
    plain = json.loads(path.read_text("utf-8"))
    for place, name in enumerate([*plain, *(f"settings.{name}" for name in plain["settings"])]):
        for value in (WRONG[place % len(WRONG)],):
            if name.startswith("settings."):
                changed = plain | {"settings": plain["settings"] | {name.partition(".")[2]: value}}
            else:
                changed = plain | {name: value}
            path.write_text(json.dumps(changed), "utf-8")
            try:
                read_summary("run")
            except fg.RunFolderError:  # as it is in every door
                continue
            capsys.readouterr()
            try:
                code = main([*arguments])
            except fg.FgMujocoError as error:
                assert "\n" not in str(error)
                code = 2
            err = capsys.readouterr().err
            assert code in (0, 1) or (code == 2 and "Traceback" not in err and err.count("\n") <= 1), (name, value)


def test_what_a_race_writes_is_accepted_of_every_vehicle(tmp_path):
    for vehicle in (*fg.vehicle_names(), made_file()):
        result = fg.race("hairpins", laps=1, vehicle=vehicle, time_limit=0.1)
        assert fg.replay(fg.write_run(result, tmp_path / fg.Vehicle.load(vehicle).name, picture=False)).identical
