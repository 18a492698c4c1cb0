"""Rollouts and comparisons with opponents: each world is its own, and is its race; what is told, and refused."""

import json

import numpy as np
import pytest

import fg_mujoco as fg
from comparison_worlds import PLANNERS, files
from fg_mujoco.cli.main import main
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.racing.entries import Entry
from fg_mujoco.racing.opponents import AmongCars
from fg_mujoco.racing.race_control import Contact, Overtake
from fg_mujoco.racing.result import trajectory_sha256
from fg_mujoco.rollouts.drive_worlds import AMONG, RESULT

TRACKS = ["oval", "hairpins"]
MIXED = [
    "disparity_extender",
    Entry(controller="pure_pursuit", max_speed=3.0, name="slow"),
    Entry(max_speed=2.0, mu=0.8),
]
DRAWN = {
    "mu": (0.7, 1.1),
    "mass": (3.2, 4.2),
    "start_s": (0.0, 10.0),
    "lidar_noise": (0.0, 0.03),
    "command_delay": [0.0, 0.05],
}
SHORT = {"randomize": DRAWN, "time_limit": 0.5, "record": "states"}
BATCHED = """

class Batched(Broken):
    @classmethod
    def batch(cls, planners):
        def decide(geometry, ranges, odometry, driving, commands):
            if odometry["stamp"][driving].max() > 0.3:
                raise ValueError("whose is it?")
            commands[driving] = 0.0, 1.0
        return decide
"""
FIELDS = {2: MIXED[:1], 4: MIXED}
AHEAD = Entry(max_speed=1.0, start=fg.Start(s=4.0))


def same(a, b):
    """Whether all bits of two arrays are the same, those of NaN too."""
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def assert_same(a, b):
    assert same(a.worlds, b.worlds)
    assert same(a.lap_times_s, b.lap_times_s)
    for world in range(len(a)):
        for trace in ("telemetry", "states", "ctrl"):
            assert same(getattr(a, trace)(world), getattr(b, trace)(world)), (world, trace)


@pytest.fixture(scope="module", params=[2, 4])
def some(request):
    """Six worlds of two tracks with two or four cars, and the opponents."""
    opponents = FIELDS[request.param]
    return fg.rollout(TRACKS, n=6, opponents=opponents, **SHORT), opponents


@pytest.fixture(scope="module")
def behind_a_slow_car():
    """Two worlds in which car 0 comes up to a car that drives at 1 m/s."""
    return fg.rollout("l_corridor", n=2, opponents=[AHEAD], max_speed=4.0, time_limit=8.0)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(PLANNERS)
    return tmp_path


# -- each world is its own


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [{"executor": fg.Executor(chunk=1)}, {"workers": 1}, {"workers": 3, "executor": fg.Executor(chunk=2)}]
)
def test_chunks_and_workers_change_nothing(some, options):
    result, opponents = some
    assert_same(fg.rollout(TRACKS, n=6, opponents=opponents, **SHORT, **options), result)


@pytest.mark.slow
def test_worlds_in_another_order_are_the_same(some):
    result, opponents = some
    own = np.flatnonzero(result["track"] == 0)[::-1]
    again = fg.rollout(TRACKS[:1], seeds=result["seed"][own], opponents=opponents, **SHORT)
    for place, world in enumerate(own.tolist()):
        assert same(again.states(place), result.states(world))
        for name in set(result.names) - {"world", "track"}:
            assert same(again[name][place], result[name][world]), name


@pytest.mark.slow
def test_processes_drive_the_same_worlds():
    threads = fg.rollout("oval", n=2, opponents=MIXED, **SHORT)
    assert_same(fg.rollout("oval", n=2, opponents=MIXED, executor="processes", workers=1, **SHORT), threads)


@pytest.mark.slow
def test_a_world_is_the_race_of_its_entries(some):
    result, opponents = some
    for world in (0, 5):
        setup = result.setup(world)
        assert len(setup.entries) == len(opponents) + 1
        race = fg.race(setup)
        assert trajectory_sha256(result.states(world), result.ctrl(world)) == race.trajectory_sha256
        assert same(result.telemetry(world), race.car.telemetry)
        for name in ("end_reason", "laps_completed", "collisions", "max_slide_m_s", "mean_speed_m_s", "sim_time_s"):
            assert result[name][world] == race.summary()[name], name
        assert result["position"][world] == race.car.position


def test_opponents_are_the_same_cars_in_each_world_with_noise_of_their_own():
    noisy = Entry(effects=fg.LidarEffects(range_noise_std=0.02), seed=3)
    result = fg.rollout("oval", n=2, opponents=[noisy, noisy], time_limit=0.1)
    seeds = [[entry.seed for entry in result.setup(world).entries] for world in range(2)]
    assert [row[0] for row in seeds] == result["seed"].tolist()
    assert len({seed for row in seeds for seed in row}) == 6


def test_the_whole_grid_moves_with_the_start_of_car_0():
    options = {"time_limit": 0.1, "opponents": ["gap_finder"]}
    placed = fg.rollout("oval", n=1, start=fg.Start(s=7.0, offset=0.2, speed=1.0), **options).setup(0).entries
    plain = fg.rollout("oval", n=1, **options).setup(0).entries
    assert [entry.start.s for entry in plain] == [0.0, -0.8]
    assert [entry.start.s for entry in placed] == [7.0, pytest.approx(6.2)]
    assert placed[0].start.offset == pytest.approx(plain[0].start.offset + 0.2)
    assert placed[1].start.offset == plain[1].start.offset
    assert [entry.start.speed for entry in placed] == [1.0, 0.0]


# -- what is told


@pytest.mark.slow
def test_car_0_overtakes_a_slow_car_ahead(behind_a_slow_car):
    result = behind_a_slow_car
    assert result["overtakes"].tolist() == [1, 1]
    assert result["position"].tolist() == [1, 1]
    assert result["overtaken"].tolist() == [0, 0]
    race = fg.race("l_corridor", entries=result.setup(0).entries, time_limit=8.0, laps=5)
    assert [(overtake.by, overtake.of) for overtake in race.overtakes] == [("car_0", "car_1")]
    assert result["contacts"][0] == len(race.contacts)


@pytest.mark.slow
def test_a_slow_car_is_overtaken_and_loses():
    fast = Entry(max_speed=4.0, name="fast")
    result = fg.rollout("scene:slow_leader:1", n=1, opponents=[fast], max_speed=1.0, laps=1)
    race = fg.race("scene:slow_leader:1", entries=result.setup(0).entries, laps=1)
    assert (result["winner"][0], result["position"][0]) == ("fast", 2) == (race.winner, race.car.position)
    summary = result.summary()
    assert summary["wins"] == 0.0 and summary["mean_position"] == 2.0
    assert summary["overtaken_per_world"] == sum(overtake.of == "car_0" for overtake in race.overtakes)


def test_figures_are_counted_for_car_0_only():
    overtakes = [Overtake(time_s=1.0, by=by, of=of, s_m=1.0) for by, of in (("car_0", "a"), ("a", "car_0"), ("a", "b"))]
    contacts = [
        Contact(
            time_s=1.0, cars=cars, impulse_Ns=1.0, closing_speed_m_s=1.0, displacement_m=0.0, at_fault=fault, x_m=0.0,
            y_m=0.0,
        )
        for cars, fault in ((("car_0", "a"), "car_0"), (("car_0", "b"), "b"), (("a", "b"), "a"))
    ]  # fmt: skip
    found = AmongCars.of(position=2, overtakes=overtakes, contacts=contacts, winner=None)
    assert found == AmongCars(position=2, overtakes=1, overtaken=1, contacts=2, contacts_at_fault=1, winner="")


def test_without_opponents_columns_and_keys_are_those_of_before():
    alone, among = (fg.rollout("oval", n=1, time_limit=0.1, opponents=cars) for cars in ((), ["gap_finder"]))
    assert alone.names == ("world", "track", *RESULT.names)
    assert among.names == (*alone.names, *AMONG.names)
    new = {"opponents", "grid", "wins", "mean_position"}
    new |= {f"{name}_per_world" for name in ("overtakes", "overtaken", "contacts", "contacts_at_fault")}
    assert set(among.summary()) - set(alone.summary()) == new
    assert [len(result.setup(0).entries) for result in (alone, among)] == [1, 2]


def test_an_opponent_that_fails_ends_its_own_race_only(here):
    bad = {"opponents": ["gap_finder", "mine.py:Broken"], "time_limit": 1.5, "record": "telemetry"}
    result = fg.rollout("oval", n=3, max_speed=3.0, **bad)
    assert result["end_reason"].tolist() == ["time_limit"] * 3
    assert len(result.telemetry(0)) == 60
    race = fg.race("oval", entries=result.setup(1).entries, time_limit=1.5, laps=5)
    assert [car.end_reason for car in race.cars] == ["time_limit", "time_limit", "planner_failed"]
    assert same(result.telemetry(1), race.car.telemetry)


def test_where_car_0_fails_the_opponents_race_on(here):
    result = fg.rollout("oval", "mine.py:Broken", n=2, opponents=["gap_finder"], time_limit=2.0)
    assert result["end_reason"].tolist() == ["planner_failed"] * 2
    assert result["sim_time_s"].tolist() == [pytest.approx(2.0)] * 2
    assert result["position"].tolist() == [2, 2]


def test_where_all_planners_fail_at_once_the_world_is_its_race_which_replays(here):
    result = fg.rollout("oval", "mine.py:Broken", n=1, opponents=["mine.py:Broken"], time_limit=1.0, record="states")
    race = fg.race("oval", entries=result.setup(0).entries, time_limit=1.0, laps=5)
    assert [car.end_reason for car in race.cars] == ["planner_failed"] * 2
    assert trajectory_sha256(result.states(0), result.ctrl(0)) == race.trajectory_sha256
    assert race.car.end_time_s == race.sim_time_s == result["sim_time_s"][0] == pytest.approx(0.2)
    fg.write_run(race, "run", picture=False)
    assert fg.replay("run").holds


@pytest.mark.slow
def test_opponents_that_decide_together_and_raise_stop_in_their_own_world_only(here):
    """Where it is not known whose failure it is, each world is driven again alone, to the same bits."""
    (here / "mine.py").write_text(PLANNERS + BATCHED)
    options = {"opponents": ["mine.py:Batched", "gap_finder"], "time_limit": 0.6, "record": "states", "max_speed": 2.0}
    result = fg.rollout("oval", n=3, randomize={"mu": (0.8, 1.0)}, **options)
    assert result["end_reason"].tolist() == ["time_limit"] * 3
    race = fg.race("oval", entries=result.setup(1).entries, time_limit=0.6, laps=5)
    assert [car.end_reason for car in race.cars] == ["time_limit", "planner_failed", "time_limit"]
    assert trajectory_sha256(result.states(1), result.ctrl(1)) == race.trajectory_sha256


# -- folders


@pytest.mark.slow
def test_a_rollout_is_gone_on_with_where_it_was(tmp_path):
    options = {"n": 4, "executor": fg.Executor(chunk=2), "opponents": MIXED, **SHORT}
    whole = fg.rollout("oval", out=tmp_path / "whole", **options)
    for name in ("chunks/000001.npz", "summary.json", "worlds.csv"):
        (tmp_path / "whole" / name).unlink()
    again = fg.rollout("oval", out=tmp_path / "whole", **options)
    assert again.worlds_driven == 2
    assert_same(again, whole)
    read = fg.read_rollout(tmp_path / "whole")
    assert_same(read, whole)
    assert read.setup(3).entries == whole.setup(3).entries
    assert read.summary()["opponents"] == whole.summary()["opponents"]


@pytest.mark.parametrize(
    "changed",
    [
        {"opponents": ()}, {"opponents": ["gap_finder"]}, {"opponents": [Entry(max_speed=3.0)]},
        {"opponents": [Entry(max_speed=2.0, name="b")]}, {"opponents": [Entry(max_speed=2.0)] * 2},
        {"opponents": [Entry(max_speed=2.0)], "grid": "side_by_side"},
    ],
)  # fmt: skip
def test_other_opponents_are_another_rollout(tmp_path, changed):
    options = {"n": 1, "time_limit": 0.1, "out": tmp_path / "out"}
    fg.rollout("oval", opponents=[Entry(max_speed=2.0)], **options)
    before = files(tmp_path)
    with pytest.raises(fg.RunFolderError, match=r"holds another rollout: (opponents|grid) is"):
        fg.rollout("oval", **options | changed)
    assert files(tmp_path) == before


def test_the_edited_file_of_an_opponent_is_another_rollout(here):
    options = {"n": 1, "time_limit": 0.1, "out": "out", "opponents": ["mine.py:Gentle"]}
    fg.rollout("oval", **options)
    (here / "mine.py").write_text(PLANNERS + "# another\n")
    with pytest.raises(fg.RunFolderError, match="holds another rollout: opponents is"):
        fg.rollout("oval", **options)


@pytest.mark.slow
def test_a_comparison_is_the_same_for_any_number_of_workers_and_gone_on_with(here):
    slowest = Entry(controller="wall_follow", max_speed=0.5, start=fg.Start(s=16.0))
    options = {"track": ["oval"], "laps": 1, "time_limit": 6.0, "opponents": [AHEAD, slowest]}
    options |= {"max_speed": (4.0,), "pictures": False}
    one = fg.compare(["gap_finder", "wall_follow"], out="one", workers=1, **options)
    fg.compare(["gap_finder"], out="two", workers=1, **options)
    two = fg.compare(["gap_finder", "wall_follow"], out="two", workers=2, **options)
    assert two.runs_driven == 1
    assert one.rows == two.rows
    assert files(here / "one") == files(here / "two")
    row = one.rows[0]
    assert row.among.overtakes == 1
    assert one.summary()["table"][0]["overtakes"] == 1
    assert one.cells[0].as_dict()["mean_position"] == row.among.position
    assert "won | mean position | overtakes" in one.markdown()
    assert (here / "one" / "runs.csv").read_text().splitlines()[0].endswith("contacts,contacts_at_fault,winner")
    with pytest.raises(fg.RunFolderError, match="holds another comparison: opponents is"):
        fg.compare(["gap_finder"], out="one", workers=1, **options | {"opponents": [AHEAD]})


@pytest.mark.slow
def test_a_finished_car_leaves_its_trace_on_the_course(here):
    """A car that has finished is taken off the course while the others race on."""
    options = {"track": ["scene:slow_leader"], "seed": [1], "max_speed": (4.0,), "pictures": False, "workers": 1}
    result = fg.compare(["gap_finder"], out="out", opponents=[Entry(max_speed=1.0)], **options)
    alone = fg.compare(["gap_finder"], out="alone", **options)
    figures, own = result.rows[0].figures, alone.rows[0].figures
    assert figures.end_reason == "finished" and result.rows[0].among.winner == "car_0"
    assert figures.sim_time_s > own.sim_time_s + 5.0
    assert figures.distance_m == pytest.approx(own.distance_m, rel=0.05)
    assert figures.least_clearance_m < 1.0


def test_without_opponents_a_comparison_has_the_keys_of_before(here):
    result = fg.compare(
        ["mine.py:Gentle"], track=["oval"], laps=1, time_limit=0.2, out="out", pictures=False, workers=1
    )
    row, manifest = result.rows[0].as_dict(), json.loads((here / "out" / "manifest.json").read_text())
    assert "position" not in row and "among" not in row
    assert "opponents" not in manifest["settings"] and "grid" not in manifest["settings"]
    assert "among" not in result.summary()["table"][0] and "won" not in result.markdown()


# -- what is refused


@pytest.mark.parametrize(
    "options, error, said",
    [
        ({"opponents": "gap_finder"}, SettingsError, "opponents is 'gap_finder'; accepted: a list"),
        ({"opponents": [3]}, SettingsError, "one of opponents is 3; accepted: the name of a planner, or "),
        ({"opponents": ["nope"]}, ControllerError, "car_1: controller 'nope' is not known; accepted: "),
        ({"opponents": ["mine.py:Nobody"]}, ControllerError, "car_1: controller 'mine.py:Nobody'"),
        ({"opponents": ["gap_finder[nope=1]"]}, ControllerError, "car_1: .* has no setting 'nope'; accepted: "),
        ({"opponents": [Entry(controller=lambda scan, odometry: None)]}, ControllerError, "is an object; accepted: "),
        ({"opponents": ["gap_finder"] * 16}, SettingsError, "17 entries; accepted: 1 to 16"),
        ({"opponents": [Entry(name="a"), Entry(name="a")]}, SettingsError, "two entries are called 'a'; accepted: "),
        ({"opponents": ["gap_finder"], "grid": "round"}, SettingsError, "grid is 'round'; accepted: staggered"),
        ({"grid": "side_by_side"}, SettingsError, "grid is 'side_by_side' without opponents; accepted: "),
        ({"opponents": [Entry(start=fg.Start(s=0.1))]}, SettingsError, "'car_1' and 'car_0' start in one place"),
        ({"opponents": [Entry(start=fg.Start(s=5.0, offset=2.0))]}, SettingsError, "'car_1' does not fit on 'oval'"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("door", ["rollout", "compare"])
def test_opponents_that_cannot_be_are_refused_before_anything_is_driven(here, door, options, error, said):
    with pytest.raises(error, match=said) as refusal:
        if door == "rollout":
            fg.rollout("oval", n=1, time_limit=0.1, out="out", **options)
        else:
            fg.compare(["gap_finder"], track=["oval"], laps=1, out="out", pictures=False, **options)
    assert "\n" not in str(refusal.value)
    assert not (here / "out").exists()


def test_a_world_in_which_a_box_stands_on_the_grid_is_named(here):
    with pytest.raises(SettingsError, match=r"^world \d+, seed \d+: 'car_\d+' does not fit on 'oval'"):
        fg.rollout("oval", n=8, time_limit=0.1, opponents=["gap_finder"] * 7, randomize={"obstacles": 9})


@pytest.mark.parametrize("command", ["rollout --track oval --n 1", "compare --track oval --out out"])
@pytest.mark.parametrize(
    "arguments, said",
    [
        ("--opponents nope", "car_1: controller 'nope' is not known"),
        ("--opponents gap_finder --grid round", "--grid is 'round'; accepted: staggered, side_by_side"),
        ("--grid side_by_side", "--grid is 'side_by_side' without opponents"),
        ("--opponent-max-speed 3", "--opponent-max-speed is given 1 times for 0 opponents"),
        (
            "--opponents gap_finder --opponent-max-speed 3 --opponent-max-speed 2",
            "--opponent-max-speed is given 2 times for 1 opponents",
        ),
        ("--opponents gap_finder --opponent-max-speed -1", "--opponent-max-speed is -1.0; accepted: a positive number"),
        ("--opponents gap_finder " * 16, "17 entries; accepted: 1 to 16"),
    ],
)  # fmt: skip
def test_a_bad_option_is_refused_in_one_line(here, capsys, command, arguments, said):
    assert main([*command.split(), *arguments.split()]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.startswith(f"fg-mujoco: {said}") and err.count("\n") == 1
    assert not (here / "out").exists()


def test_the_command_is_the_function(here, capsys):
    arguments = "rollout --n 2 --time-limit 0.2 --max-speed 5 --opponents gap_finder --opponents wall_follow --json"
    assert main([*arguments.split(), "--opponent-max-speed", "3", "--opponent-max-speed", "2", "--out", "out"]) == 0
    told = json.loads(capsys.readouterr().out)
    opponents = [Entry(max_speed=3.0, seed=1), Entry(controller="wall_follow", max_speed=2.0, seed=2)]
    result = fg.rollout("oval", n=2, time_limit=0.2, max_speed=5.0, opponents=opponents)
    assert same(fg.read_rollout("out").worlds, result.worlds)
    assert told["opponents"] == result.summary()["opponents"]
