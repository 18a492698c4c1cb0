"""What a newcomer types works, or one line says what does: in Python, as planners, in environments, as commands."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from conftest import Straight
from fg_mujoco.errors import MessageError
from fg_mujoco.simulation.telemetry import TELEMETRY

SHORT = {"laps": 1, "time_limit": 0.1}


def straight(scan, odometry):
    """Drive on, slowly."""
    return fg.DriveCommand(steering_angle=0.0, speed=1.0)


@pytest.fixture(scope="module")
def simulation():
    return fg.Simulation(fg.World("oval"))


@pytest.fixture(scope="module")
def scan(simulation):
    return simulation.reset()[0]


# results


def test_a_column_of_a_race_is_found_without_its_unit(short_race):
    for plain, name in (("speed", "speed_m_s"), ("x", "x_m"), ("yaw_rate", "yaw_rate_rad_s"), ("ax", "ax_m_s2")):
        np.testing.assert_array_equal(short_race.car.column(plain), short_race.car.telemetry[:, TELEMETRY.index(name)])


@each(
    ("name", "meant"),
    [
        ("time", "'sim_time_s'"), ("laps", "'car.laps_completed'"), ("best_lap", "'car.lap_times_s'"),
        ("speed", "\"car.column('speed_m_s')\""), ("lidar", "'setup.lidar'"), ("rules", "'setup.rules'"),
    ],
)  # fmt: skip
def test_an_attribute_that_a_result_has_not_is_answered_with_the_one_that_was_meant(short_race, name, meant):
    with pytest.raises(AttributeError) as caught:
        getattr(short_race, name)
    assert str(caught.value) == f"RaceResult has no {name!r}; did you mean {meant}?"


def test_an_attribute_that_python_itself_looks_for_is_no_matter_of_names(scan):
    assert not hasattr(scan, "_repr_latex_")
    assert pickle.loads(pickle.dumps(scan)).stamp == scan.stamp


# arguments


@each(
    ("name", "meant"),
    [
        ("make", "gymnasium.make('fg_mujoco/F1Tenth-v0')"), ("F1TenthEnv", "gymnasium.make('fg_mujoco/F1Tenth-v0')"),
        ("Race", "race"), ("run", "race"), ("planners", "controller_names"), ("vehicles", "vehicle_names"),
        ("maps", "track_names"), ("loadtrack", "load_track"), ("Planner", "Controller"), ("Odom", "Odometry"),
    ],
)  # fmt: skip
def test_a_name_that_the_package_has_not_is_answered_with_the_one_that_was_meant(name, meant):
    with pytest.raises(AttributeError) as caught:
        getattr(fg, name)
    assert str(caught.value) == f"fg_mujoco has no {name!r}; did you mean {meant!r}?"


def test_numpys_numbers_are_taken_as_numbers():
    plain = fg.race("oval", Straight(), laps=1, time_limit=0.1, seed=3, obstacles=2, obstacle_seed=1, mu=0.75)
    found = fg.race(
        "oval", Straight(), laps=np.int64(1), time_limit=np.float64(0.1), seed=np.int32(3), obstacles=np.int64(2),
        obstacle_seed=np.uint8(1), mu=np.float32(0.75),
    )  # fmt: skip
    assert found.trajectory_sha256 == plain.trajectory_sha256
    assert (type(found.car.seed), type(found.laps_requested), type(found.car.mu)) == (int, int, float)


# a simulation that is stepped by hand


def test_ranges_that_are_written_to_say_that_a_copy_can_be(scan):
    before = np.array(scan.ranges)
    for write in (
        lambda ranges: ranges.__setitem__(..., 5.0), lambda ranges: ranges[:3].__setitem__(0, 5.0),
        lambda ranges: ranges.__setitem__(ranges > 3.0, 3.0), lambda ranges: ranges.__iadd__(1.0),
        lambda ranges: ranges.sort(), lambda ranges: ranges.fill(1.0),
    ):  # fmt: skip
        with pytest.raises(MessageError, match=r"accepted: a copy, ranges = scan.ranges.copy\(\)"):
            write(scan.ranges)
        np.testing.assert_array_equal(scan.ranges, before)
        for copied in (scan.ranges.copy(), np.array(scan.ranges), scan.ranges[scan.ranges > 0.0], scan.ranges * 1.0):
            write(copied)
            assert not np.array_equal(copied, before)


def test_what_is_computed_of_ranges_is_a_plain_array_with_the_same_bits(scan):
    plain = np.array(scan.ranges)
    assert type(plain) is np.ndarray
    for work in (np.sort, np.diff, lambda x: np.minimum(x, 3.0), lambda x: 2.0 * x, np.copy, lambda x: x.copy()):
        assert type(work(scan.ranges)) is np.ndarray
        np.testing.assert_array_equal(work(scan.ranges), work(plain))
    for work in (np.min, np.mean, np.argmax):
        assert type(work(scan.ranges)) is type(work(plain))
        assert work(scan.ranges) == work(plain)


# planners


def test_a_function_is_a_planner():
    class Same:
        def reset(self):
            pass

        def __call__(self, scan, odometry):
            return straight(scan, odometry)

    found = fg.race("oval", straight, **SHORT)
    assert found.trajectory_sha256 == fg.race("oval", Same(), **SHORT).trajectory_sha256
    assert found.car.controller == "straight"
    assert Path(found.car.controller_origin["file"]).name == Path(__file__).name


@pytest.fixture
def planner_file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from fg_mujoco import DriveCommand\n\n\n"
        "def follow(scan, odometry):\n    return DriveCommand(steering_angle=0.0, speed=1.0)\n\n\n"
        "def fails(scan, odometry):\n    scan.ranges.clip(0.0, 1.0, out=scan.ranges)\n\n\n"
        "def helper(x):\n    return x\n\n\n"
        "class Without:\n    def __call__(self, scan, odometry):\n        return follow(scan, odometry)\n"
    )
    return path


def test_a_function_in_a_file_is_a_planner_on_the_command_line_and_in_a_rollout(planner_file, capsys):
    from fg_mujoco.cli.main import main

    assert main(["race", "--controller", f"{planner_file}:follow", "--time-limit", "0.1", "--json"]) == 1
    assert '"controller": "' + f"{planner_file}:follow" in capsys.readouterr().out
    by_file = fg.race("oval", f"{planner_file}:follow", **SHORT)
    assert by_file.trajectory_sha256 == fg.race("oval", straight, **SHORT).trajectory_sha256
    assert by_file.car.controller_source == planner_file.read_bytes()
    worlds = fg.rollout("oval", f"{planner_file}:follow", n=2, time_limit=0.1)
    assert worlds["end_reason"].tolist() == ["time_limit"] * 2


@each(
    ("name", "said"),
    [
        (":helper", r"is the function helper\(x\); accepted: helper\(scan, odometry\)"),
        (":Without", r"has no reset\(\), .*; accepted: .* `def reset\(self\): pass`"),
        (":folow", "did you mean 'follow'"),
        ("", "the name of its class is missing; accepted: .*mine.py:Without, .*mine.py:follow, .*mine.py:fails$"),
    ],
)
def test_what_is_no_planner_in_a_file_says_what_to_add(planner_file, name, said):
    with pytest.raises(fg.ControllerError, match=said):
        fg.race("oval", f"{planner_file}{name}", **SHORT)


def test_a_planner_that_writes_to_a_scan_by_numpy_is_told_to_copy(planner_file):
    with pytest.warns(UserWarning, match=r"read-only; .* ranges = scan.ranges.copy\(\) \(.*mine.py, line 9\)"):
        result = fg.race("oval", f"{planner_file}:fails", **SHORT)
    assert result.car.end_reason == "planner_failed"


# environments

IMPORTS = {
    "fg_mujoco first": "import fg_mujoco; assert 'gymnasium' not in sys.modules; import gymnasium",
    "gymnasium first": "import gymnasium; import fg_mujoco",
    "looked for before": "import fg_mujoco, importlib.util; importlib.util.find_spec('gymnasium'); import gymnasium",
}


@pytest.mark.slow
@each("imports", IMPORTS.values(), ids=IMPORTS)
def test_import_fg_mujoco_registers_the_environment(imports):
    pytest.importorskip("gymnasium")
    program = (
        f"import sys; {imports}\n"
        "assert 'fg_mujoco.envs.gym_environment' not in sys.modules\n"
        "spec = gymnasium.spec('fg_mujoco/F1Tenth-v0')\n"
        "print(spec.entry_point, spec.vector_entry_point, [type(each).__name__ for each in sys.meta_path])\n"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert ran.stderr == ""
    assert "gym_environment:F1TenthEnv fg_mujoco.envs.gym_vector:F1TenthVectorEnv" in ran.stdout
    assert "_Waiting" not in ran.stdout


@pytest.mark.slow
@each("display", ["", ":987"])
def test_a_window_without_a_display_is_refused_and_the_program_goes_on(display):
    pytest.importorskip("gymnasium")
    pytest.importorskip("pettingzoo")
    program = (
        "import fg_mujoco as fg, gymnasium\n"
        "name = 'fg_mujoco/F1Tenth-v0'\n"
        "for make in (lambda: gymnasium.make(name, render_mode='human'),\n"
        "             lambda: gymnasium.make_vec(name, num_envs=2, render_mode='human'),\n"
        "             lambda: fg.parallel_env(agents=2, render_mode='human')):\n"
        "    try:\n"
        "        make().reset(seed=0)\n"
        "    except fg.FgMujocoError as error:\n"
        "        print(error)\n"
        "print('goes on')\n"
    )
    quiet = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    environment = quiet | ({"DISPLAY": display} if display else {})
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment)
    said = ran.stdout.splitlines()
    assert said[0].startswith("no window can be opened: there is no display; accepted: a display; without one, render")
    assert [line.partition("; ")[2] for line in said[1:3]] == ["accepted: rgb_array, None"] * 2
    assert said[3:] == ["goes on"]
    assert ran.returncode == 0
