"""Files and values that are too much, or no files: each is refused in one line that names it, before any work on it."""

import math
import os

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.options import in_one_line
from fg_mujoco.course.files import is_file, is_folder, read_bytes, read_text, require_regular
from fg_mujoco.course.track import MOST_POINTS
from refusals import refused

LINE = [(0.0, 0.0), (5.0, 0.0), (10.0, 1.0), (10.0, 5.0), (5.0, 6.0), (0.0, 5.0)]
LONG = "a" * 5000
MAP = """image: {image}
resolution: {resolution}
origin: {origin}
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def csv_of(first=None, width=1.0, shift=0.0):
    points = [first, *LINE[1:]] if first else LINE
    return "".join(f"{x + shift!r}, {y!r}, {width!r}, {width!r}\n" for x, y in points)


def csv_ring(count, width):
    angles = [2.0 * math.pi * k / count for k in range(count)]
    return "".join(f"{50.0 * math.cos(a):.6f}, {50.0 * math.sin(a):.6f}, {width / 2}, {width / 2}\n" for a in angles)


def map_of(image="map.png", resolution="0.05", origin="[0, 0, 0]", before=""):
    return before + MAP.format(image=image, resolution=resolution, origin=origin)


def laughs():
    lines = ["a: &a [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"{new}: &{new} [{', '.join([f'*{old}'] * 10)}]" for old, new in zip("abcdefgh", "bcdefghi", strict=True)]
    return "\n".join(lines) + "\n"


TRACKS = {
    "coordinate of 1e5 m": (csv_of((1e5, 0.0)), "the centreline is", "long; accepted: 30000 m"),
    "coordinate of 1e150 m": (csv_of((1e150, 0.0)), "1e+150", "1e+09 at most"),
    "far away": (csv_of(shift=1e12), "1000000000000.0", "1e+09 at most"),
    "width of 1e9 m": (csv_of(width=1e9), "2000000000 m wide: millimetres?", "accepted: metres"),
    "points without end": ("1, 2, 1, 1\n" * (MOST_POINTS + 1), f"line {MOST_POINTS + 1}", f"{MOST_POINTS} at most"),
    "points side by side": (csv_of() + "5.0, 5.0, 1.0, 1.0\n" * 20_000, "points", "20000 at most of a course"),
    "points too close": (csv_ring(15_000, 20.0), "15000 points, 0.02", "accepted: points 0.1 m apart"),
    "comments without end": ("# a,b\n" * 2000 + csv_of(), "lines without a point", "1000 above the first"),
    "lines without end": ("\n" * 500_000 + csv_of(), "lines without a point", "1000 above the first"),
    "a name without end": ("x,y,width," + "_".join("a" * 9000) + "\n1,2,3,4\n", "0 points", "at least 4"),
    "a header without end": ("x,y,width," + "_".join("a" * 30000) + "\n", "line 1 has 60010 char", "20000 at most"),
    "columns without end": ("x,y," + ",".join(map(str, range(300))) + "\n", "line 1: more than 200 col", "200 at most"),
    "NUL": (csv_of().replace("5.0", "5\0"), "is not a text file", "accepted: a .csv"),
    "digits": (csv_of().replace("0.0, 0.0", "9" * 5000 + ", 0.0", 1), "line 1", "a finite number"),
}


@pytest.mark.slow
@each("name", TRACKS)
def test_tracks_that_are_too_much(name, here, capsys):
    text, *said = TRACKS[name]
    (here / "mine.csv").write_text(text, "utf-8")
    err = refused(here, capsys, "track", "show", "mine.csv")
    assert "mine.csv: " in err and all(part in err for part in said)
    assert len(err) < 4500


MAPS = {
    "billion laughs": (map_of(origin="*i", before=laughs()), "line 2", "an alias in the place of a value"),
    "an alias of itself": ("a: &a [*a]\n" + map_of(), "line 1", "an alias"),
    "levels": (map_of(origin="[" * 50_000 + "]" * 50_000), "line 3", "more than 20 levels; accepted: the keys"),
    "digits": (map_of(resolution="9" * 5000), "line 2", "5000 characters, more than 1000; accepted: the keys"),
    "a number beyond floats": (map_of(resolution="9" * 400), "resolution is 999", "accepted: the side of a pixel"),
    "origin far away": (map_of(origin="[1.0e+12, 0, 0]"), "origin is [1000000000000.0", "within 10000"),
    "resolution of nothing": (map_of(resolution="1.0e-300"), "resolution is 1e-300", "accepted: the side of a pixel"),
    "no date": (map_of(resolution="2001-99-99"), "month must be in", "is no YAML"),
    "a tag without a value": (map_of(resolution='!!int ""'), "is no YAML", "mine.yaml"),
    "a tag of Python": (map_of(resolution="!!python/object/apply:os.getcwd []"), "no YAML", "python/object"),
    "an image with NUL": (map_of(image='"a\\0.png"'), "image is 'a\\x00.png'", "accepted: the name of a file"),
    "an image with a long name": (map_of(image="a" * 900 + ".png"), "cannot be read as an image", "PNG or PGM"),
    "an image that is a FIFO": (map_of(image="pipe"), "pipe: cannot be read as an image: is a FIFO", "PNG or PGM"),
    "an image that is a folder": (map_of(image="folder"), "folder: cannot be read as an image: is a folder", "PNG"),
    "a large file": (map_of() + "#" * 2**20, "has more than 1048576 bytes", "mine.yaml"),
}  # fmt: skip


@each("name", MAPS)
def test_maps_that_are_too_much(name, here, capsys):
    pytest.importorskip("yaml", reason="no yaml here: pip install -e '.[maps]'")
    text, *said = MAPS[name]
    (here / "mine.yaml").write_text(text, "utf-8")
    os.mkfifo(here / "pipe")
    (here / "folder").mkdir()
    err = refused(here, capsys, "track", "show", "mine.yaml")
    assert all(part in err for part in said)
    assert len(err) < 4500


def test_an_image_is_refused_by_its_header_alone(here, capsys):
    """It has no pixels at all behind it: decoding it would be said to fail."""
    pytest.importorskip("PIL", reason="no Pillow here: pip install -e '.[maps]'")
    (here / "mine.yaml").write_text(map_of(image="map.pgm"), "utf-8")
    (here / "map.pgm").write_bytes(b"P5 10000 10000 255\n")
    err = refused(here, capsys, "track", "show", "mine.yaml")
    assert err.startswith("fg-mujoco: map.pgm: 10000 x 10000 pixels; accepted: ")


CONFIGS = {
    "levels": ("track = " + "[" * 900 + "]" * 900 + "\n", "nested too deep"),
    "dotted levels": ("a" + ".a" * 50_000 + " = 1\n", "race.toml, line 1: 100005 characters; accepted: 2000 at most"),
    "digits": ("laps = " + "9" * 1900 + "\n", "accepted: whole numbers from"),
    "lines": ("# x\n" * 20_000 + "lapps = 1\n", "20002 lines; accepted: 1000 at most"),
    "NUL": ("track = 'a\0'\n", "accepted: TOML"),
    "a name with NUL": ('track = "a\\u0000.csv"\n', "line 1: track: "),
    "a large file": ("#" * (2**20 + 1), "has more than 1048576 bytes"),
}


@each("name", CONFIGS)
def test_settings_that_are_too_much(name, here, capsys):
    text, said = CONFIGS[name]
    (here / "race.toml").write_text(text, "utf-8")
    err = refused(here, capsys, "race", "--config", "race.toml")
    assert err.startswith("fg-mujoco: race.toml") and err.count("race.toml") == 1 and said in err
    assert len(err) < 4500


DOORS = (
    ("track", "show", "{}.yaml"),
    ("race", "--track", "{}.csv"),
    ("race", "--vehicle", "{}.xml"),
    ("race", "--controller", "{}.py:Planner"),
    ("race", "--config", "{}.toml"),
    ("replay", "{}"),
    ("report", "{}"),
    ("render", "{}", "--frame", "0", "--out", "picture.png"),
)


@each("kind", ["FIFO", "device", "folder", "long", "NUL", "not UTF-8", "nothing"])
def test_what_is_no_file_is_refused_at_every_door(kind, here, capsys):
    name = {"long": LONG, "NUL": "a\0b", "not UTF-8": "a\udcff"}.get(kind, "thing")
    for end in ("", ".csv", ".yaml", ".xml", ".py", ".toml"):
        if kind == "FIFO":
            os.mkfifo(here / f"thing{end}")
        elif kind == "device":
            (here / f"thing{end}").symlink_to("/dev/zero")
        elif kind == "folder":
            (here / f"thing{end}").mkdir()
    for arguments in DOORS:
        err = refused(here, capsys, *(argument.format(name) for argument in arguments))
        assert len(err) < 4500


def test_only_regular_files_of_a_bounded_size_are_read(here):
    (here / "text").write_bytes(b"\xef\xbb\xbfone\r\ntwo")
    assert (read_text("text"), read_bytes("text", 11)) == ("one\ntwo", b"\xef\xbb\xbfone\r\ntwo")
    with pytest.raises(OSError, match="more than 10 bytes"):
        read_bytes("text", 10)
    os.mkfifo("pipe")
    for name in ("pipe", "/dev/zero", ".", "none", LONG, "a\0b"):
        with pytest.raises(OSError):
            require_regular(name)
        assert not is_file(name)
    assert is_file("text") and is_folder(".") and not is_folder("text") and not is_folder(LONG)


def test_a_message_is_one_line_that_a_terminal_shows():
    assert in_one_line("a  short\nmessage") == "a short message"
    assert in_one_line(f"{'x' * 5000}: accepted") == f"{'x' * 100}...{'x' * 59}: accepted"
    assert len(in_one_line("word " * 10_000)) < 4500
    assert in_one_line("a\udcff\x1b[2J\0.csv") == "a\\udcff\\x1b[2J\\x00.csv"
    assert in_one_line("μ of 3 m/s²") == "μ of 3 m/s²"


@each("text", ["map.yaml[close=.3]" * 10_000, "a" + " " * 500_000 + "["])
def test_names_that_are_too_long(text):
    with pytest.raises(fg.TrackError, match=f"has {len(text)} characters; accepted: 8192 at most"):
        fg.load_track(text)
    with pytest.raises(fg.SettingsError, match=f"has {len(text)} characters; accepted: 8192 at most"):
        fg.race("oval", text)


def test_a_line_that_goes_to_and_fro_is_refused_before_any_work_on_it():
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    ring = 3.0 * np.column_stack((np.cos(angle), np.sin(angle)))
    line = np.concatenate((ring[:9], np.tile(ring[7:9], (10_000, 1)), ring[9:]))
    with pytest.raises(fg.TrackError, match=r"has 62\d\d m in the square metre at \(2, 2\); accepted: 20 m at most"):
        fg.Track(name="x", centreline=line, width_right=np.ones(len(line)), width_left=np.ones(len(line)))
