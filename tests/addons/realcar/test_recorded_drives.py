"""Recorded drives: what is read from CSV files, what their sensors say of each other, and what is refused."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.realcar.drives.drive_columns import LAYOUTS
from fg_mujoco.addons.realcar.drives.reading import read_drive, read_drives
from fg_mujoco.addons.realcar.identification.drive_log import Drive
from fg_mujoco.cli.main import main
from refusals import refused

SHARED = Path(__file__).resolve().parent.joinpath("../../../../shared/data/real_drives").resolve()
WHEELBASE, OFFSET = 0.32, 0.02
HEADER = "time_s,speed_m_s,yaw_rate_rad_s,steering_rad,speed_command_m_s,x_m,y_m,yaw_rad"


def motion(seconds=40.0, step=0.02):
    """A car without slip on a winding way, as an independent integration of its path: columns by their names."""
    fine = np.arange(0.0, seconds, 0.001)
    speed = 3.0 + np.sin(0.7 * fine) + 0.5 * np.sin(2.1 * fine)
    curvature = 0.25 * np.sin(0.9 * fine) + 0.1 * np.sin(2.7 * fine)
    yaw_rate = speed * curvature
    yaw = np.cumsum(yaw_rate) * 0.001
    x, y = (np.cumsum(speed * turn) * 0.001 for turn in (np.cos(yaw), np.sin(yaw)))
    time = np.arange(0.5, seconds - 0.5, step)
    made = {"time": time, "steering": OFFSET + WHEELBASE * np.interp(time, fine, curvature)}
    for name, values in (("speed", speed), ("yaw_rate", yaw_rate), ("x", x), ("y", y), ("yaw", yaw)):
        made[name] = np.interp(time, fine, values)
        made[f"late {name}"] = lambda delay, values=values: np.interp(time - delay, fine, values)
    return made


def said_of(path, **options):
    """The message by which a drive is refused, which is one line."""
    with pytest.raises(fg.SettingsError) as refused:
        read_drive(path, **options)
    assert "\n" not in str(refused.value) and "accepted" in str(refused.value)
    return str(refused.value)


def write(path, columns, header=HEADER):
    names = ("time", "speed", "yaw_rate", "steering", "speed", "x", "y", "yaw")
    rows = np.column_stack([columns[name] for name in names])
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.6f")
    return path


def spoilt(tmp_path, **changed):
    """The path of a drive with some columns changed."""
    return write(tmp_path / "drive.csv", motion() | changed)


def test_clock_gyro_delays_and_steering_offset_are_found(tmp_path):
    made = motion()
    path = spoilt(tmp_path, time=made["time"] / 0.9, yaw_rate=1.05 * made["late yaw_rate"](0.09),
                  speed=made["late speed"](0.06))  # fmt: skip
    checks = read_drive(path).checks
    assert checks.clock_scale.value == pytest.approx(0.9, abs=0.004)
    assert checks.gyro_scale.value == pytest.approx(1.0 / 1.05, abs=0.004)
    assert checks.yaw_rate_delay.value * 0.9 == pytest.approx(0.09, abs=0.01)
    assert checks.speed_delay.value * 0.9 == pytest.approx(0.06, abs=0.01)
    assert checks.steering_offset.value == pytest.approx(OFFSET, abs=0.004)
    assert "the clock says 11.1 % too much" in str(checks) and "(corrected)" not in str(checks)
    columns = {name: value for name, value in LAYOUTS["plain"].items() if "acceleration" not in name}
    measured = {"time": {"column": "time_s", "scale": "measured"}} | {name: {"column": columns[name],
            "delay": "measured"} for name in ("speed", "yaw_rate")}  # fmt: skip
    measured["yaw_rate"]["scale"] = "measured"
    drive = read_drive(path, columns=columns | measured)
    rows, first = drive.rows, made["time"][0] / 0.9
    true = first + made["time"] - made["time"][0]
    assert rows.yaw_rate == pytest.approx(np.interp(rows.time, true, made["yaw_rate"]), abs=0.02)
    assert rows.speed == pytest.approx(np.interp(rows.time, true, made["speed"]), abs=0.03)
    assert set(drive.checks.used) == {"clock_scale", "gyro_scale", "speed_delay", "yaw_rate_delay"}


@each("changes, said",
      [(lambda m: {"steering": np.degrees(m["steering"])}, "steering_rad: steering reaches .* looks like deg"),
       (lambda m: {"steering": 1500.0 + 500.0 * m["steering"]}, "ticks of a servo"),
       (lambda m: {"speed": 3.6 * m["speed"]}, "speed_m_s: speed is .* times that of the poses; .* looks like km/h"),
       (lambda m: {"speed": 4614.0 * m["speed"]}, "looks like ticks or ERPM"),
       (lambda m: {"yaw_rate": np.degrees(m["yaw_rate"])}, "yaw_rate_rad_s: yaw_rate reaches .* looks like deg/s"),
       (lambda m: {"time": 1e3 * m["time"]}, "a row every 20 s; it looks like ms"),
       (lambda m: {"x": 1e3 * m["x"], "y": 1e3 * m["y"]}, "x_m: x moves .* looks like mm"),
       (lambda m: {"yaw": np.degrees(np.remainder(0.8 * m["time"], 2.0 * np.pi) - np.pi)},
        "yaw_rad: yaw jumps by .* looks like deg"),
       (lambda m: {"steering": -m["steering"]}, "steering turns the other way than the yaw rate; .* scale of -1"),
       (lambda m: {"yaw_rate": -m["yaw_rate"]}, "yaw_rate turns the other way than the poses; .* scale of -1")])
def test_a_wrong_unit_is_recognised(changes, said, tmp_path):
    path = spoilt(tmp_path, **changes(motion()))
    with pytest.raises(fg.SettingsError, match=said):
        read_drive(path)


@each("pause, carried", [(3600.0, 3.0), (86400.0, 0.0)])
def test_a_drive_is_cut_at_a_pause_which_is_said(pause, carried, tmp_path):
    """Whether the car is carried elsewhere in the pause or not."""
    made = motion()
    time, x = made["time"].copy(), made["x"].copy()
    time[1000:] += pause
    x[1000:] += carried
    drive = read_drive(spoilt(tmp_path, time=time, x=x))
    assert any("pauses of more than 1 s: 1, the longest" in line for line in drive.lines)
    with pytest.raises(fg.SettingsError, match=r"drive.csv: pauses; accepted: .*parts"):
        Drive.of_recorded(drive, fg.Vehicle.load().parameters, "f1tenth")
    with pytest.warns(UserWarning, match=f"is cut at pauses of more than 1 s: 1, the longest {pause + 0.02:.6g} s"):
        parts = drive.parts()
    assert [part.name for part in parts] == [f"{drive.name}, {each}" for each in ("0 to 19.98 s",
                                                 f"{pause + 20:.4g} to {pause + 38.98:.4g} s")]  # fmt: skip
    for part, rows in zip(parts, (slice(None, 1000), slice(1000, None)), strict=True):
        assert np.allclose(part.speed.time, time[rows]) and np.allclose(part.pose.values[:, 0], x[rows], atol=1e-6)
        assert part.parts() == [part] and part.part_of == drive.name


def test_a_long_drive_is_taken_in_parts_that_are_evenly_spread(tmp_path):
    made = motion()
    whole = {name: np.tile(made[name], 25) for name in ("time", "speed", "yaw_rate", "steering", "x", "y", "yaw")}
    whole["time"] = np.arange(len(whole["time"])) * 0.02
    with pytest.warns(UserWarning, match="lasts 975 s, of which 10 parts of up to 30 s are taken"):
        parts = read_drive(spoilt(tmp_path, **whole)).parts()
    begins = [part.start for part in parts]
    assert sum(part.end - part.start for part in parts) == pytest.approx(300.0, abs=10.0)
    assert begins[0] == 0.0 and parts[-1].end == pytest.approx(974.98) and np.ptp(np.diff(begins)) < 31.0


@each("first, by, said", [
    (1, 1.7e9, "line 3: time_s: the clock jumps by 1.7e\\+09 s at 1700000000.5"),
    (700, 0.5, "line 702: time_s: the clock jumps by 0.52 s"),  # while the poses go on
    (700, -1.0, "line 702: time_s: the clock runs backwards by 0.98 s")
])
def test_a_clock_that_jumps_is_refused_with_its_row(first, by, said, tmp_path):
    time = motion()["time"].copy()
    time[first:] += by
    with pytest.raises(fg.SettingsError, match=said):
        read_drive(spoilt(tmp_path, time=time))


def test_comments_above_the_header_and_between_rows_are_left_out(tmp_path):
    path = spoilt(tmp_path)
    header, *rows = path.read_text().splitlines()
    plain = read_drive(path)
    for number, names in enumerate((header, f"# {header}", f'"{header.replace(",", chr(34) + "," + chr(34))}"')):
        made = tmp_path / "folder" / f"{number}.csv"
        made.parent.mkdir(exist_ok=True)
        above = ["# by hand, 20 \u00b0C", '# start :,"[0, 0, 0]", 25 Hz', "", names]
        lines = [*above, *rows[:50], "", "  # a lap", *rows[50:]]
        made.write_text("\n".join(lines), encoding="latin-1" if number else "utf-8")
        assert np.array_equal(read_drive(made).speed.values, plain.speed.values)
    spoilt_row = tmp_path / "row.csv"
    spoilt_row.write_bytes(made.read_bytes().replace(rows[100].encode(), b"1," + rows[100].encode()))
    assert "line 107: 9 cells" in said_of(spoilt_row)
    assert len(read_drives(tmp_path / "folder")) == 3
    made.write_bytes(path.read_bytes().replace(b",", b",\0"))
    assert "is not a text file" in said_of(made)


@each("name, value", product(HEADER.split(","), ("-1e308", "9" * 400, "inf", "1e30", "-2e8")))
def test_a_number_that_is_no_measurement_is_refused_with_its_line(name, value, here, capsys):
    header, *rows = write(here / "drive.csv", motion(4.0)).read_text().splitlines()
    cells = rows[50].split(",")
    cells[header.split(",").index(name)] = value
    Path("drive.csv").write_text("\n".join([header, *rows[:50], ",".join(cells), *rows[51:]]))
    line = refused(here, capsys, "bag", "drive.csv")
    assert f"drive.csv, line {53 if 'backwards' in line and value[0] != '-' else 52}: {name}" in line


def test_files_that_cannot_be_read_are_refused_in_one_line(tmp_path):
    made = motion()
    time = made["time"].copy()
    time[500:] -= 3.0
    assert "line 502: time_s: the clock runs backwards by 2.98 s" in said_of(spoilt(tmp_path, time=time))
    path = write(tmp_path / "drive.csv", made, header=HEADER.replace("yaw_rate_rad_s", "gyro"))
    assert "of no known layout: time_s, speed_m_s, gyro" in said_of(path)
    columns = {"time": "time_s", "speed": "speed_m_s", "yaw_rate": "gyr", "steering": "steering_rad"}
    assert "did you mean 'gyro'?" in said_of(path, columns=columns)
    assert "has no yaw_rate" in said_of(path, columns={"time": "time_s", "speed": "speed_m_s"})
    assert "did you mean 'steering'?" in said_of(path, columns={"steerin": "steering_rad"})
    measured = columns | {"yaw_rate": {"column": "gyro", "scale": "measured"}}
    assert "needs poses" in said_of(path, columns=measured)
    for path in (tmp_path / "none.csv", tmp_path / f"{'a' * 300}.csv", tmp_path / "a\0.csv"):
        assert "cannot be read" in said_of(path)
    path = write(tmp_path / "drive.csv", made)
    for row in ("9" * 200_000, '"1,2', "a" * 200_000 + ",1" * 7):
        with path.open("a") as file:
            file.write(f"{row}\n")
        assert "line 1952: " in said_of(path)
        write(path, made)


def test_a_run_gives_what_its_car_measured(tmp_path):
    run = fg.race("oval", laps=1, time_limit=4.0)
    folder = tmp_path / "run"
    fg.write_run(run, folder, picture=False)
    drive = read_drive(folder)
    rows = drive.rows
    assert drive.layout == "run" and rows.beams.shape[1] == 1081 and len(drive.steering.time) == len(run.ctrl)
    assert rows.pose[-1, 0] - rows.pose[0, 0] != 0.0 and abs(rows.speed).max() > 1.0


def test_the_commands_of_bags_read_csv_files(here, capsys):
    made = motion(8.0)
    header = f"{HEADER},{','.join(f'beam_{number:04d}_m' for number in range(40, 1040, 25))}"
    names = ("time", "speed", "yaw_rate", "steering", "speed", "x", "y", "yaw")
    rows = np.column_stack([made[name] for name in names] + [np.full((len(made["time"]), 40), 3.0)])
    np.savetxt("drive.csv", rows, delimiter=",", header=header, comments="", fmt="%.5f")
    plain = "".join(f'{name} = "{LAYOUTS["plain"][name]}"\n' for name in ("time", "speed", "yaw_rate", "steering"))
    Path("columns.toml").write_text(plain + 'beams = {columns = "beam_{}_m", count = 1080}\n')
    assert main(["bag", "drive.csv", "--columns", "columns.toml"]) == 0
    assert "beams               350 times, 50 Hz, 3 to 3" in capsys.readouterr().out
    assert main(["replay-scans", "drive.csv", "--columns", "columns.toml", "--out", "out.csv"]) == 0
    assert len(Path("out.csv").read_text().splitlines()) == 351
    capsys.readouterr()
    assert "has no beams" in refused(here, capsys, "replay-scans", "drive.csv", "--out", "other.csv")


@pytest.mark.skipif(not SHARED.is_dir(), reason="the shared drives of a real car are not here")
def test_the_real_drives_are_recognised_and_their_clocks_found():
    """README.md of the drives: "the set of 2025 runs about 10 % off against the poses, its gyro about 5 % high"."""
    drives = read_drives(SHARED)
    assert len(drives) == 18 and {drive.layout for drive in drives} == {"real_drives"}
    for drive in drives:
        nominal = "ipz8" not in drive.name
        if drive.end - drive.start > 10.0:
            assert drive.checks.clock_scale.value == pytest.approx(1.0 if nominal else 0.9, abs=0.02)
            assert 0.95 < drive.checks.gyro_scale.value < 1.0
        assert drive.beams.ranges.shape[1] == 40 and drive.beams.bearings[20] == pytest.approx(0.0, abs=0.003)
