"""Anyone's centreline CSV loads; what cannot be a track is refused in one line."""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.course.centreline_csv import DENSE, read_centreline
from fg_mujoco.course.polyline import enclosed_area, step_lengths
from fg_mujoco.errors import TrackError
from fg_mujoco.simulation.course_loading import load_track

HEADER = "# x_m, y_m, w_tr_right_m, w_tr_left_m\n"


def ellipse_rows(spacing=0.2, right=1.0, left=1.2):
    """Rows of a track of about 100 m."""
    count = round(100.0 / spacing)
    angle = 2.0 * np.pi * np.arange(count) / count
    return [(20.0 * math.cos(a), 11.0 * math.sin(a), right, left) for a in angle.tolist()]


def text_of(rows, separator=", "):
    return "".join(separator.join(repr(value) for value in row) + "\n" for row in rows)


@pytest.fixture
def read(tmp_path):
    def read(text, name="some.csv"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_centreline(path)

    return read


ROWS = ellipse_rows()


@each(
    "text",
    [
        HEADER + text_of(ROWS), text_of(ROWS), "x_m,y_m,w_tr_right_m,w_tr_left_m\n" + text_of(ROWS, ","),
        HEADER + "# another comment\n\n" + text_of(ROWS), text_of(ROWS, "; "), text_of(ROWS, ";"), text_of(ROWS, " "),
        text_of(ROWS, "\t"), text_of([*ROWS, ROWS[0]]), text_of([*ROWS[:9], ROWS[8], *ROWS[9:]]),
        (HEADER + text_of(ROWS)).replace("\n", "\r\n"), "\ufeff" + HEADER + text_of(ROWS), "\ufeff" + text_of(ROWS),
        text_of(ROWS).rstrip("\n"), text_of(ROWS).replace("\n", "  \n"),
    ],
)  # fmt: skip
def test_every_dialect_gives_the_same_track(read, text):
    track = read(text)
    assert track.name == "some"
    np.testing.assert_array_equal(track.centreline, np.array(ROWS)[:, :2])
    np.testing.assert_array_equal(track.width_right, 1.0)
    np.testing.assert_array_equal(track.width_left, 1.2)


def raceline_rows():
    """Rows of s, x, y, psi, kappa, vx, ax, of which x and y count."""
    return [(0.2 * k, x, y, 7.0, 8.0, 9.0, -1.0) for k, (x, y, _, _) in enumerate(ROWS)]


@each(
    "text",
    [
        "# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2\n" + text_of(raceline_rows(), "; "),
        "s_m,x_m,y_m,psi_rad,kappa_radpm,vx_mps,ax_mps2\n" + text_of([*raceline_rows(), raceline_rows()[0]], ","),
        text_of([row[:2] for row in ROWS], ","),
        "x,y,v\n" + text_of([(*row[:2], 5.0) for row in ROWS], ","),
    ],
    ids=["tum", "tum-repeated", "points", "speeds"],
)
def test_a_file_without_widths_is_a_track_of_the_width_that_is_given(tmp_path, text):
    path = tmp_path / "line.csv"
    path.write_text(text)
    track = load_track(f"{path}[width=1.5]")
    assert track.name == "line"
    np.testing.assert_array_equal(track.centreline, np.array(ROWS)[:, :2])
    np.testing.assert_array_equal(track.width_right, 0.75)
    np.testing.assert_array_equal(track.width_left, 0.75)
    with pytest.raises(TrackError, match=r"has no widths, but columns .*; accepted: line\.csv\[width=W\]"):
        load_track(path)


def named(header, **columns):
    """A file with these columns, x and y of ROWS unless they are given, and `right` and `left` of 1.0 and 1.2 m."""
    x, y, right, left = zip(*ROWS, strict=True)
    known = {"x": x, "y": y, "right": right, "left": left, "zero": [0.0] * len(x), **columns}
    names = [cell.partition("=") for cell in header.split(",")]
    rows = zip(*(known[which or name] for name, _, which in names), strict=True)
    return ",".join(name for name, _, _ in names) + "\n" + text_of(rows, ",")


@each(
    "text",
    [
        named("x_m=x,y_m=y,w_tr_left_m=left,w_tr_right_m=right"),
        "# " + named("x_m=x,y_m=y,w_tr_left_m=left,w_tr_right_m=right"),
        "# made by: somebody, somewhere, in, winter\n# columns: " + named("left,right,y,x"),
        named("w_left=left,w_right=right,Y [m]=y,X [m]=x"),
        named("id=zero,s_m=zero,center_x_m=x,center_y_m=y,wLeft=left,wRight=right,left_boundary_x_m=zero"),
        named("s_m=zero,x_m=x,y_m=y,psi_rad=zero,kappa_radpm=zero,vx_mps=zero,ax_mps2=zero,d_right=right,d_left=left"),
        named("x_ref_m=x,y_ref_m=y,width_right_m=right,width_left_m=left,x_normvec_m=zero,y_normvec_m=zero"),
        named('=zero,"x_m"=x,"y_m"=y,"width_left"=left,"width_right"=right'),
        named("x_m=x,y_m=y,w_left_cm=cm,w_right_mm=mm", cm=[120.0] * len(ROWS), mm=[1000.0] * len(ROWS)),
        ("# Gr\xf6\xdfe\n" + text_of(ROWS)).encode("latin-1"),
    ],
)
def test_a_header_that_names_its_columns_is_obeyed(read, text):
    track = read(text)
    np.testing.assert_array_equal(track.centreline, np.array(ROWS)[:, :2])
    np.testing.assert_allclose(track.width_right, 1.0)
    np.testing.assert_allclose(track.width_left, 1.2)


def test_one_width_that_is_named_is_that_from_wall_to_wall(read):
    track = read(named("x,y,track_width=left"))
    np.testing.assert_array_equal((track.width_right, track.width_left), 0.6)


ANGLE = [2.0 * math.pi * k / len(ROWS) for k in range(len(ROWS))]
YAW = [math.atan2(11.0 * math.cos(a), -20.0 * math.sin(a)) % (2.0 * math.pi) + 0.01 for a in ANGLE]
QUATERNION = [
    (x, y, 0.0, 0.0, 0.0, math.sin(0.5 * a), math.cos(0.5 * a)) for (x, y, _, _), a in zip(ROWS, YAW, strict=True)
]


@each(
    ("text", "message"),
    [
        (named("x,y,yaw,v=right", yaw=YAW), "has no widths, but columns x, y, yaw, v; accepted"),
        (text_of([(x, y, yaw, 2.5) for (x, y, _, _), yaw in zip(ROWS, YAW, strict=True)]), "x_m, y_m, psi_rad, vx"),
        (text_of([(*at[:2], 2.5, math.degrees(yaw)) for at, yaw in zip(ROWS, YAW, strict=True)]), "vx_mps, psi_rad"),
        (named("x,y,z=zero,qx=zero,qy=zero,qz=zero,qw=right"), "has no widths, but columns x, y, z, qx"),
        (text_of(QUATERNION), "the first is no distance along the line; accepted: s_m, x_m"),
        (named("x,y,w_left=left"), "line 1 names one side's width only, w_left"),
        (named("lon=x,lat=y,right,left"), "line 1 names no x and y, in lon, lat, right, left; accepted"),
        ("# " + named("lon=x,lat=y,right,left"), "line 1 names no x and y, in lon, lat"),
        (named("x_px=x,y_px=y,right,left"), "names no x and y, in x_px"),
        (named("x_m=x,y_m=y,x_ref_m=x,y_ref_m=y,right,left"), "names several lines, x_m, x_ref_m"),
        (named("x,y,x,y"), "names several lines, x, x"),
        ("x,y\n" + text_of(ROWS, ","), "line 2 has 4 columns; accepted: 2, x, y"),
        (text_of(ROWS[:400]), "the line ends 17.55 m from its first point, in steps of 0.25 m at most"),
        (text_of([(100.0 * x, 100.0 * y, 110.0, 110.0) for x, y, _, _ in ROWS]), "9945 m long and 220 m wide: centim"),
        (text_of([(1e3 * x, 1e3 * y, 1100.0, 900.0) for x, y, _, _ in ROWS]), "2000 m wide: millimetres"),
    ],
)  # fmt: skip
def test_columns_that_are_no_course_are_refused_by_what_they_are(read, text, message):
    with pytest.raises(TrackError, match=message) as refusal:
        read(text)
    assert "\n" not in str(refusal.value)


@each("direction", ["clockwise", "counterclockwise"])
def test_a_track_is_turned_round_on_request(tmp_path, direction):
    path = tmp_path / "some.csv"
    path.write_text(text_of(ROWS))
    given, turned = load_track(path), load_track(f"{path}[direction={direction}]")
    assert (enclosed_area(turned.centreline) > 0.0) == (direction == "counterclockwise")
    np.testing.assert_array_equal(turned.centreline[0], given.centreline[0])
    is_same = direction == "counterclockwise"
    np.testing.assert_array_equal(turned.width_right, 1.0 if is_same else 1.2)
    np.testing.assert_array_equal(turned.width_left, 1.2 if is_same else 1.0)


@each("width", ["0", "-1", "nan", "inf", "220"])
def test_a_width_that_no_course_has_is_refused(tmp_path, width):
    path = tmp_path / "some.csv"
    path.write_text(text_of([row[:2] for row in ROWS]))
    said = "220 m wide: centimetres" if width == "220" else "width is .*; accepted: a positive number of metres"
    with pytest.raises(TrackError, match=said):
        load_track(f"{path}[width={width}]")


@each("spacing", [0.1, 0.2, 0.4, 0.6, 1.0, 2.0, 5.0])
def test_any_spacing_gives_the_same_smooth_circuit(read, spacing):
    track = read(text_of(ellipse_rows(spacing)))
    assert step_lengths(track.centreline).max() <= DENSE
    x, y = track.centreline.T
    np.testing.assert_allclose(np.hypot(x / 20.0, y / 11.0), 1.0, atol=0.006)
    # between its radii at the ends of the axes
    assert np.all((track.curvature > 0.8 * 11.0 / 20.0**2) & (track.curvature < 1.2 * 20.0 / 11.0**2))


GOOD = text_of(ROWS[:20])


@each(
    ("text", "message"),
    [
        ("", "is empty"),
        (HEADER + text_of(ROWS[:3]), "3 points; accepted: at least 4"),
        (text_of(ROWS[:1] * 9), "0 points; accepted: at least 4"),
        (GOOD + "1.0, nan, 1.0, 1.0\n", "line 21: y_m is 'nan'; accepted: a finite number"),
        (GOOD + "1.0, wide, 1.0, 1.0\n", "line 21: y_m is 'wide'"),
        (HEADER + "\n" + GOOD + "1.0, 2.0, 1.0\n", "line 23 has 3 columns; accepted: 4, x_m, y_m"),
        (GOOD + "1.0, 2.0, 1.0, 1.0, 5.0\n", "line 21 has 5 columns"),
        ("1, 2, 3, 4, 5\n", "line 1 has 5 columns; accepted: 4, x_m, .*; or, without widths, 2, 3, 4, 6 or 7"),
        (GOOD + "1.0, 2.0, 0.0, 1.0\n", "line 21: w_tr_right_m is 0.0; accepted: a number above 0"),
        (b"\x89PNG\r\n\x1a\n\x00\xff\xfe", "is not a text file"),
        (text_of([(x, x * y / 20.0, 1.0, 1.0) for x, y, _, _ in ROWS]), "crosses itself near"),
        (text_of(ellipse_rows(right=1.0, left=12.0)), "no room for the left wall|runs over itself"),
    ],
)
def test_what_is_no_track_is_refused_in_one_line_that_names_the_file(read, text, message):
    with pytest.raises(TrackError, match=message) as refusal:
        read(text)
    assert "some.csv" in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert "accepted" in str(refusal.value)
