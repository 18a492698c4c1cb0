"""Run folders that somebody made to harm: each is refused in one line, whoever reads it, before any work on it."""

import io
import json
import shutil
import zipfile

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.course.mjcf import MOST_BODIES
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


@pytest.fixture(scope="module")
def raced(tmp_path_factory):
    """A run of twelve ticks, as `race --out` writes it."""
    folder = tmp_path_factory.mktemp("raced") / "run"
    main(["race", "--laps", "1", "--time-limit", "0.3", "--out", str(folder)])
    (folder / "report.html").unlink(missing_ok=True)
    return without_checksums(folder)  # so that what is read is checked for itself


@pytest.fixture
def here(raced, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(raced, tmp_path / "run")
    return tmp_path


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def header(text):
    """Return the beginning of an .npy file."""
    text = text.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


def states(here, *, keep=("time", "state", "ctrl"), **members):
    """Write other members into states.npz: bytes as they are, arrays as .npy."""
    path = here / "run/states.npz"
    with np.load(path) as file:
        written = {name: npy(file[name]) for name in keep}
    written |= {name: value if isinstance(value, bytes) else npy(value) for name, value in members.items()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in written.items():
            archive.writestr(f"{name}.npy", content)


def edited(here, change):
    """Write the states with some of their numbers changed."""
    with np.load(here / "run/states.npz") as file:
        array = file["state"].copy()
    change(array)
    states(here, state=array)


def listing(here):
    """Say of states.npz that the list of its members is most of it."""
    path = here / "run/states.npz"
    content = bytearray(path.read_bytes())
    content[-10:-6] = (2**17).to_bytes(4, "little")
    path.write_bytes(b"\0" * 2**17 + bytes(content))


def doubled(here):
    with zipfile.ZipFile(here / "run/states.npz", "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("time.npy", npy(np.zeros(13)))


def set_to(value):
    def change(array):
        array[5, 7] = value

    return change


ROW = "{'descr': '<f8', 'fortran_order': False, 'shape': %s, }"
STATES = {
    "a bomb": (lambda h: states(h, state=np.zeros((2**23,))), "its arrays have more than "),
    "objects": (lambda h: states(h, state=np.array([{}], dtype=object)), "Object arrays|of object"),
    "texts": (lambda h: states(h, time=np.full(13, "a" * 8)), "of <U8"),
    "whole numbers": (lambda h: states(h, time=np.arange(13)), "int64"),
    "NaN": (lambda h: edited(h, set_to(np.nan)), "state has a number that is none"),
    "infinite": (lambda h: edited(h, set_to(np.inf)), "state has a number that is none"),
    "beyond": (lambda h: edited(h, set_to(1e300)), "beyond 1e"),
    "rows": (lambda h: states(h, ctrl=np.zeros((50_000, 2))), r"shapes \(13,\)"),
    "columns": (lambda h: states(h, ctrl=np.zeros((12, 3))), r"\(12, 3\)"),
    "a huge shape": (lambda h: states(h, state=header(ROW % "(2305843009213693952, 8)")), "has 0 bytes of an array"),
    "a negative shape": (lambda h: states(h, state=header(ROW % "(-1, -1)") + b"\0" * 8), "of an array"),
    "nothing many times": (
        lambda h: states(h, time=header(ROW.replace("<f8", "|S0") % "(1000000000000,)")), "of an array",
    ),
    "a header that is none": (lambda h: states(h, state=header("(" * 100)), "states.npz"),
    "another format": (lambda h: states(h, state=b"\x93NUMPY\x02\x00" + b"\xff" * 100), "another version"),
    "no state": (lambda h: states(h, keep=("time", "ctrl")), "it has not the arrays time, state, ctrl"),
    "one more": (lambda h: states(h, more=np.zeros(1)), "and no others"),
    "one twice": (doubled, "and no others"),
    "a long list": (listing, "the list of its members"),
    "torn": (lambda h: (h / "run/states.npz").write_bytes((h / "run/states.npz").read_bytes()[:-9]), "no end"),
    "empty": (lambda h: (h / "run/states.npz").write_bytes(b""), "no end of a ZIP"),
    "time begins before": (lambda h: states(h, time=np.arange(13) - 5.0), "accepted: within 0 to 1e"),
    "time far away": (lambda h: states(h, time=np.arange(13) * 1e12), "accepted: within 0 to 1e"),
    "time stands": (lambda h: states(h, time=np.zeros(13)), "time does not grow"),
}  # fmt: skip


def text_of(name, change):
    """Return what changes the text of a file of the run."""

    def spoil(here):
        path = here / "run" / name
        path.write_text(change(path.read_text("utf-8")), "utf-8")

    return spoil


def table(change):
    """Return what changes the text of telemetry.csv."""
    return text_of("telemetry.csv", change)


def cell(value, column=3):
    def change(text):
        lines = text.splitlines()
        row = lines[4].split(",")
        lines[4] = ",".join([*row[:column], value, *row[column + 1 :]])
        return "\n".join(lines) + "\n"

    return table(change)


TELEMETRY = {
    "columns": (table(lambda text: "a," * 10**6 + "\n"), "columns a,a,"),
    "columns in a row": (table(lambda text: text + "1," * 10**6 + "\n"), "line 14 is torn, too long"),
    "torn": (table(lambda text: text[:-5]), "line 13 is torn"),
    "a word": (cell("fast"), "could not convert"),
    "NaN": (cell("nan"), "a number that is none"),
    "infinite": (cell("inf", -3), "a number that is none"),
    "beyond": (cell("1e300"), "beyond 1e"),
    "bytes": (lambda h: (h / "run/telemetry.csv").write_bytes(b"\xff" * 100), "columns "),
    "NUL": (cell("\0"), "could not convert"),
}


STATES |= {
    "a row less": (table(lambda text: "\n".join(text.splitlines()[:-1]) + "\n"), "for the 11 rows"),
    "a row more": (table(lambda text: text + text.splitlines()[-1] + "\n"), "for the 13 rows"),
    "no row": (table(lambda text: text.splitlines()[0] + "\n"), "more than|for the 0 rows"),
}


def summary(**changes):
    def spoil(here):
        path = here / "run/summary.json"
        path.write_text(json.dumps(json.loads(path.read_text("utf-8")) | changes), "utf-8")

    return spoil


def text_of_summary(text):
    return lambda here: (here / "run/summary.json").write_text(text, "utf-8")


SUMMARIES = {
    "levels": (text_of_summary('{"schema": ' + "[" * 200_000 + "]" * 200_000 + "}"), "is no JSON: nested too deep"),
    "digits": (text_of_summary('{"schema": ' + "9" * 5000 + "}"), "digits"),
    "NaN": (text_of_summary('{"schema": 1, "mu": NaN}'), "mu is nan"),
    "a large file": (text_of_summary(" " * 2**20 + "{}"), "has more than 1048576 bytes"),
    "an end that is a text": (summary(cars=[{"end_time_s": ""}]), "cars is "),
    "laps": (summary(laps_requested=10**9), "accepted: a whole number from 0 to 1000"),
}  # fmt: skip


def scene(change):
    """Return what changes the text of scene.xml."""
    return text_of("scene.xml", change)


def added(text):
    return scene(lambda xml: xml.replace("</mujoco>", text + "</mujoco>"))


SCENES = {
    "empty": (scene(lambda xml: ""), "no XML: no element found"),
    "text": (scene(lambda xml: "hello"), "no XML"),
    "a robot": (scene(lambda xml: "<robot/>"), "accepted: one <mujoco>"),
    "nothing in it": (scene(lambda xml: "<mujoco/>"), "car/"),
    "an include": (added('<include file="/etc/passwd"/>'), "<include>"),
    "a mesh's file": (added('<asset><mesh name="a" file="/etc/passwd"/></asset>'), "names a file"),
    "a look beside": (scene(lambda xml: xml.replace('"f1tenth_look.xml"', '"../evil.xml"')), "text 'car/look' is"),
    "a LiDAR beside": (
        scene(lambda xml: xml.replace('file" data="hokuyo_ust10lx.xml"', 'file" data="../evil.xml"')),
        "'car/lidar/file' is",
    ),
    "bodies": (added("<worldbody>" + "<body/>" * (MOST_BODIES + 1) + "</worldbody>"), f"more than {MOST_BODIES} bod"),
    "levels": (added("<worldbody>" + "<body>" * 1000 + "</body>" * 1000 + "</worldbody>"), "more than 100 levels"),
    "a large file": (scene(lambda xml: xml + " " * 2**24), "has more than 16777216 bytes"),
    "a timestep of nothing": (scene(lambda xml: xml.replace("0.005", "1e-300", 1)), "<option timestep> has 1e-300"),
    "another timestep": (scene(lambda xml: xml.replace("0.005", "0.007", 1)), "a whole fraction"),
    "another car": (scene(lambda xml: xml.replace('name="car/chassis"', 'name="car/other"')), "chassis"),
    "another actuator": (
        added('<actuator><general name="x" joint="car/steering"/></actuator>'), "states.npz|car/steering",
    ),
}  # fmt: skip

HOSTILE = {
    (file, name): case
    for file, cases in {
        "states.npz": STATES, "telemetry.csv": TELEMETRY, "summary.json": SUMMARIES, "scene.xml": SCENES,
    }.items()
    for name, case in cases.items()
}  # fmt: skip


def pick(door):
    """Skip what needs an extra that is not here."""
    if door in EXTRAS:
        pytest.importorskip(EXTRAS[door], reason=f"no {EXTRAS[door]} here")
    return DOORS[door]


@each(("file", "name"), HOSTILE)
def test_a_hostile_folder_is_refused_in_one_line(file, name, here, capsys):
    import re

    spoil, said = HOSTILE[file, name]
    spoil(here)
    err = refused(here, capsys, "replay", "run")
    assert err.startswith(f"fg-mujoco: run/{file}: ") and re.search(said, err)
    assert len(err) < 500
    with pytest.raises(fg.RunFolderError):
        fg.replay("run")


@each("door", ["report", "render", "export"])
@each(
    ("file", "name"),
    [("states.npz", "NaN"), ("telemetry.csv", "columns"), ("summary.json", "levels"), ("scene.xml", "a mesh's file")],
)  # fmt: skip
def test_every_door_refuses_them(door, file, name, here, capsys):
    arguments = pick(door)
    HOSTILE[file, name][0](here)
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
        for value in (WRONG[place % len(WRONG)],):  # tests/fuzzing tries the others
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
