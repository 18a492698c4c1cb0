"""Courses and lines in the files of other stacks: each is read by its names, driven for a lap, or refused in a line."""

import json
import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.course.line_file import raceline_columns, read_line_file
from fg_mujoco.errors import Note, TrackError
from fg_mujoco.simulation.course_loading import load_track

ANGLE = np.linspace(0.0, 2.0 * math.pi, 200, endpoint=False)
LINE = np.column_stack((9.0 * np.cos(ANGLE) + 1.2 * np.cos(3.0 * ANGLE), 6.0 * np.sin(ANGLE)))
MADE = raceline_columns(LINE, 2.5 + np.cos(2.0 * ANGLE))
NORMAL = np.column_stack((-np.sin(MADE["psi_rad"]), np.cos(MADE["psi_rad"])))
LEFT, RIGHT = LINE + 0.9 * NORMAL, LINE - 1.1 * NORMAL
WIDTHS = {"right": np.full(200, 1.1), "left": np.full(200, 0.9)}
KNOWN = {
    **{name.partition("_")[0]: column for name, column in MADE.items()}, **WIDTHS, "zero": np.zeros(200),
    "jumps": np.where(np.arange(200) % 20 < 9, 20.0, 0.9),
    "id": np.arange(200.0), "zone": ["straight"] * 200, "slow": np.ones(200), "deg": np.degrees(MADE["psi_rad"]),
    "kmh": 3.6 * MADE["vx_mps"], "lx": LEFT[:, 0], "ly": LEFT[:, 1], "rx": RIGHT[:, 0], "ry": RIGHT[:, 1],
}  # fmt: skip


def table(header, before="", separator=","):
    """Text of columns `NAME` or `NAME=KNOWN`."""
    names = [cell.partition("=") for cell in header.split(",")]
    columns = [KNOWN[which or name.partition("_")[0]] for name, _, which in names]
    rows = [separator.join(map(str, row)) for row in zip(*columns, strict=True)]
    return "\n".join([before + separator.join(name for name, _, _ in names), *rows]) + "\n"


def rows(header):
    names = [cell.partition("=") for cell in header.split(",")]
    columns = [np.asarray(KNOWN[which or name.partition("_")[0]]).tolist() for name, _, which in names]
    return [dict(zip([name for name, _, _ in names], row, strict=True)) for row in zip(*columns, strict=True)]


WAYPOINT = "id,s_m,d_m=zero,x_m,y_m,d_right=right,d_left=left,psi_rad,kappa_radpm=kappa,vx_mps{},ax_mps2"
WAYPOINTS = json.dumps({
    "map_info_str": {"data": "lap 5 s"},
    "centerline_markers": {"markers": [{"pose": {"position": {"x": 0.0, "y": 0.0}}}] * 3},
    "centerline_waypoints": {"wpnts": rows(WAYPOINT.format("=zero"))},
    "global_traj_wpnts_iqp": {"wpnts": rows(WAYPOINT.format(""))},
    "global_traj_wpnts_sp": {"wpnts": rows(WAYPOINT.format("=slow"))},
})  # fmt: skip
MPCC = json.dumps({
    name: KNOWN[column].tolist()
    for name, column in zip(["X", "Y", "X_i", "Y_i", "X_o", "Y_o"], ["x", "y", "lx", "ly", "rx", "ry"], strict=True)
})  # fmt: skip
TUM, CHINA = "s_m,x_m,y_m,psi_rad,kappa_radpm,vx_mps,ax_mps2", ",speed_limit_mps=slow,speed_zone=zone"
CENTRE, SIDES = "x_m,y_m,w_tr_right_m=right,w_tr_left_m=left", ",w_tr_right_m=right,w_tr_left_m=left"
LTPL = "x_ref_m=x,y_ref_m=y,width_right_m=right,width_left_m=left,x_normvec_m=slow,y_normvec_m=zero,alpha_m=slow"

COURSES = {
    "tum.csv": table(CENTRE, "# "),
    "named.csv": table(CENTRE),
    "ini.csv": table(TUM + ",d_right_iqp=right,d_left_iqp=left"),
    "forza.csv": table(TUM + ",d_left_m=left,d_right_m=right", "# made of a bag\n# "),
    "china9.csv": table(TUM + SIDES),
    "china10.csv": table("index=id,s_m,center_x_m=x,center_y_m=y,w_left_m=left,w_right_m=right,left_boundary_x_m=lx,"
                         "left_boundary_y_m=ly,right_boundary_x_m=rx,right_boundary_y_m=ry"),
    "china11.csv": table(TUM + CHINA + SIDES),
    "ltpl.csv": table(LTPL, "# uuid\n# ", "; "),
    "global_waypoints.json": WAYPOINTS,
    "track.json": MPCC,
    "rows.json": json.dumps(np.column_stack((LINE, WIDTHS["right"], WIDTHS["left"])).tolist()),
    "bounds.csv": table("left_x=lx,left_y=ly,right_x=rx,right_y=ry"),
    "left.csv[boundary=right.csv]": table("x_m=lx,y_m=ly"),
    "paddock/track.yaml": "surface: carpet\nclosed: true\ncentreline: centreline.csv\n",
    "centre.npy": np.column_stack((LINE, WIDTHS["right"], WIDTHS["left"])),
    "fields.npy": np.rec.fromarrays([*LINE.T, WIDTHS["left"], WIDTHS["right"]], names="x,y,w_left,w_right"),
}  # fmt: skip


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "paddock").mkdir()
    (tmp_path / "paddock/centreline.csv").write_text(table(CENTRE, "# "))
    np.savetxt(tmp_path / "right.csv", RIGHT[::-3], delimiter=",", header="x,y")
    return tmp_path


def write(name, content):
    path = name.partition("[")[0]
    if isinstance(content, str):
        with open(path, "w") as file:
            file.write(content)
    else:
        np.save(path, content)
    return name


@each("name", COURSES)
def test_a_course_of_any_stack_is_read_by_its_names_and_driven(name):
    write(name, COURSES[name])
    with pytest.warns(Note, match="points of"):
        track = load_track(name)
    assert track.length == pytest.approx(MADE["s_m"][-1], rel=0.02)
    for drawn, true in ((track.centreline, LINE), (track.left_wall, LEFT), (track.right_wall, RIGHT)):
        assert max(np.hypot(*(true - point).T).min() for point in drawn) < 0.25  # a step
    assert fg.race(track, "gap_finder", laps=1).car.finished


LINES = {
    "tum.csv": table(TUM, "# uuid\n# ", "; "),
    "china11.csv": table(TUM + CHINA + SIDES),
    "kmh.csv": table("x_m,y_m,speed_kmh=kmh,yaw_deg=deg"),
    "global_waypoints.json": WAYPOINTS,
    "line.npy": np.column_stack((LINE, MADE["vx_mps"])),
    "log.csv": "".join(table("x,y,psi,vx", separator=", ").splitlines(True)[1:]),
    "echo.trj": "Recorded on Monday\n" + table("%time=s,pose.pose.position.x=x,pose.pose.position.y=y,linear.x=vx"),
}


@each("name", LINES)
def test_a_line_of_any_stack_has_its_speeds_and_is_followed(name):
    file = read_line_file(write(name, LINES[name]), course=False)
    np.testing.assert_allclose(file.points, LINE, atol=1e-9)
    np.testing.assert_allclose(file.values["speed"], MADE["vx_mps"], atol=1e-9)
    write("tum_course.csv", COURSES["tum.csv"])
    assert fg.race("tum_course.csv", f"pure_pursuit[line={name}]", laps=1).car.finished


def test_a_planner_follows_the_line_and_not_the_reference_of_tums_local_planner():
    file = read_line_file(write("l.csv", table(LTPL)), course=False)
    np.testing.assert_allclose(file.points, np.add(LINE, (1.0, 0.0)))
    np.testing.assert_allclose(read_line_file("l.csv", course=True).points, LINE)


def test_convert_writes_a_centreline_or_a_raceline_that_are_read_back(capsys):
    write("w.json", WAYPOINTS)
    assert main(["track", "convert", "w.json", "centre.csv"]) == 0
    said = capsys.readouterr()
    assert "of its lines centerline_waypoints" in said.err and "not used: id, s_m" in said.err
    np.testing.assert_allclose(load_track("centre.csv").centreline, LINE)
    assert main(["track", "convert", "w.json", "sp.csv", "--raceline", "--line", "sp"]) == 0
    file = read_line_file("sp.csv", course=False)
    np.testing.assert_allclose(file.values["speed"], 1.0)
    np.testing.assert_allclose(file.values["psi"], MADE["psi_rad"], atol=1e-6)
    assert main(["track", "convert", "w.json", "no.csv", "--line", "fast"]) == 2
    assert "accepted: one of centerline_waypoints, global_traj_wpnts_iqp" in capsys.readouterr().err


def test_convert_takes_a_track_of_ours_by_its_name(capsys):
    assert main(["track", "convert", "oval", "oval.csv"]) == 0
    np.testing.assert_allclose(load_track("oval.csv").centreline, load_track("oval").centreline, atol=1e-5)
    assert main(["track", "convert", "oval", "line.csv", "--raceline"]) == 0
    line = read_line_file("line.csv", course=False).points
    np.testing.assert_allclose(line, load_track("oval").centreline, atol=1e-5)
    for name, said in (("scene:dead_end:1", "has no centreline with widths"), ("ovel", "did you mean 'oval'")):
        assert main(["track", "convert", name, "no.csv"]) == 2 and said in capsys.readouterr().err


@each("name", ["tum.csv", "tum"])
def test_a_course_is_scaled_whatever_its_suffix(name):
    write(name, COURSES["tum.csv"])
    track, small = load_track(f"{name}[scale=1]"), load_track(f"{name}[scale=0.5]")
    assert small.length == pytest.approx(0.5 * track.length) and small.width_left[0] == pytest.approx(0.45)


def test_widths_that_jump_are_said_and_one_may_stand_for_all():
    write("rays.csv", table("x,y,w_left=left,w_right=jumps"))
    with pytest.warns(Note, match=r"a width is 20 m, most are 0.9: rays.csv\[width=W\] sets one for all"):
        assert load_track("rays.csv").width_right.max() == 20.0
    with pytest.warns(Note, match="width=2 in place of its widths$"):
        assert load_track("rays.csv[width=2]").width_right.max() == 1.0


def spoiled(text, cell, place):
    lines = text.splitlines()
    cells = lines[place].split(",")
    cells[0] = cell
    return "\n".join([*lines[:place], ",".join(cells), *lines[place + 1 :]])


@each(
    ("name", "content", "message"),
    [
        ("a.csv", table(CENTRE + ",w_tr_left_m=left"), "line 1 has a column twice, 'w_tr_left_m' and 'w_tr_left_m'"),
        ("a.csv", table(CENTRE + ",vx_mps,vx=slow"), "a column twice, 'vx_mps' and 'vx'"),
        ("a.csv", table(CENTRE + ",x=y"), "a column twice, 'x_m' and 'x'"),
        ("a.csv", table(CENTRE + ",vx_mps=kmh"), "in km/h for 6; accepted: m/s"),
        ("a.csv", table(CENTRE + ",psi_rad=deg"), "psi_rad turns with the line in degrees; accepted: radians"),
        ("a.csv", spoiled(table(CENTRE), "nan", 7), "line 8: x_m is 'nan'; accepted: a finite number"),
        ("a.csv", "\n".join(table(CENTRE).splitlines()[:3]), "2 points; accepted: at least 4"),
        ("a.csv", table("x,y=zero,v=y").partition("\n")[2], "column 2 is 0 everywhere; accepted: x_m, y_m, vx_mps"),
        ("a.csv", table(CENTRE) + "\n".join(table(CENTRE).splitlines()[1:101]), "its first 200 points may be a lap"),
        ("a.csv", table("x,y,w_left=jumps,w_right=right"), "20 m, most are 1.1: a.csv.width=W. sets"),
        ("a.json", "{", "is no JSON"),
        ("a.json", json.dumps({"a": 1}), "has no line; accepted: rows or columns with the names x and y"),
        ("a.json", json.dumps({"X": [0, 1, 2], "Y": [0, 1]}), "columns of different lengths, X 3, Y 2"),
        ("a.json", json.dumps([{"x": 0, "y": 1}, {"x": 2}]), "point 2: y is 'None'; accepted: a finite number"),
        ("a.json", '{"x": [0, 1, 1, 0], "x": [0, 2, 2, 0], "y": [0, 0, 1, 1]}', "the key 'x' is given twice"),
        ("a.json", json.dumps([{"x": 0, "y": 1}, {"x": True, "y": 2}]), "point 2: x is 'True'; accepted: a"),
        ("a.json", f'{{"x": [0, {"9" * 400}], "y": [0, 1]}}', "point 2: x is '999"),
        ("a.json", json.dumps({str(key): {} for key in range(3000)}), "more than 2000 objects"),
        ("a.json", json.dumps({"x": [0, *[1] * 200_001], "y": [0, 1]}), "more than 200000 points"),
        ("a.csv[scale=1e300]", table(CENTRE), "scale is 1e.300; accepted: 1e-06 to 1e.06"),
        ("a.csv[width=1e300]", table(CENTRE), "width is 1e.300; accepted: a positive number of metres, 30 at"),
        ("a.csv", "".join(f"{k}, {k * k % 7}, inf, 3\n" for k in range(50)), "line 1: w_tr_right_m is 'inf'"),
        ("paddock/track.yaml", "centreline: a.csv\ncentreline: centreline.csv", "line 2: the key 'centreline'"),
        ("a.npy", LINE[:, 0], "has float64 of shape .200,.; accepted: numbers .n, k."),
        ("a.npy", np.zeros((20, 9)), "has 9 columns; accepted: 4, x_m"),
        ("left.csv[boundary=left.csv]", table("x=lx,y=ly"), "the boundaries cross near"),
        ("left.csv[boundary=other.csv]", table("x=lx,y=ly"), "other.csv: no such file"),
        ("left.csv", table("x=lx,y=ly"), "or, of a boundary, left.csv.boundary=FILE"),
        ("paddock/track.yaml", "closed: false\ncentreline: centreline.csv", "closed is False; accepted: true"),
        ("paddock/track.yaml", "centreline: ../right.csv", "accepted: a CSV in its folder"),
    ],
)  # fmt: skip
def test_what_cannot_be_a_course_is_refused_in_a_line(name, content, message):
    with pytest.raises(TrackError, match=message) as refusal:
        load_track(write(name, content))
    assert "\n" not in str(refusal.value)


def test_speeds_that_no_corner_holds_are_in_km_h():
    with pytest.raises(TrackError, match="in corners, in km/h for 6; accepted: m/s, or a name that ends in _kmh"):
        read_line_file(write("l.csv", table("x_m,y_m,vx_mps=kmh")), course=False)
