"""What no setting can be, at every door: refused before anything runs, in one line that names it and what is accepted.

The fields come from the dataclasses, the words from the registries and the options from the parser, so that a new one
is tried without a word here. `LINES` and `CALLS` have what several settings together cannot be, and near misses.
"""

import dataclasses
import json
import math
import re
from dataclasses import fields

import numpy as np
import pytest

import fg_mujoco as fg
import fg_mujoco.controllers
from cases import each
from conftest import Straight
from fg_mujoco.cli.main import _parser, main
from fg_mujoco.controllers.control.driving import DrivingSettings
from fg_mujoco.controllers.gap_finder import GapFinder
from fg_mujoco.controllers.weighted_gap import WeightedGapSettings
from fg_mujoco.course.built_walls import Walls
from fg_mujoco.course.formats import track_names
from fg_mujoco.course.ground import Relief
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.observations import ObservationTerm
from fg_mujoco.envs.rewards import Rewards
from fg_mujoco.errors import GONE, ArgumentError, accepted_names, nearest
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.lab import load_experiment
from fg_mujoco.lab.manoeuvres import MANOEUVRES
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.messages import CarParameters, PlannerContext
from fg_mujoco.pictures.rendering.cameras import find_camera
from fg_mujoco.pictures.rendering.overlays import find_overlays
from fg_mujoco.racing.planners import controller_names
from fg_mujoco.racing.randomization import Randomization
from fg_mujoco.racing.setup import FIELD_OF, SETUP_KEYWORDS, Setup
from fg_mujoco.simulation.settings import Scenario, Start
from fg_mujoco.vehicle.sensors import SENSORS
from fg_mujoco.vehicle.tires import Brush, Coulomb, Linear, MagicFormula, tire_names
from refusals import assert_bounds, classes_that_validate, refused
from scan_worlds import CAR, MU

NAMES = {name: field for name, (_, field) in FIELD_OF.items()} | {
    "lidar_effects": "LidarEffects", "entries": "entr", "start": "Start.", "opponents": "opponent", "rewards": "eward",
    "end_conditions": "end condition", "planner_settings": "setting", "observation": "Part.",
    "mus": "mu is", "planner_mus": "planner_mu is", "steerings": "steering is",
}  # fmt: skip
"""What a refusal says in place of the keyword: the field of the part that it is, or a word for one of several."""


def check(name, value, call):
    with pytest.raises(fg.FgMujocoError) as refusal:
        call()
    said = str(refusal.value)
    assert "\n" not in said and len(said) < 2000 and "accepted: " in said, (name, value, said)
    assert name in said or NAMES.get(name, name) in said, (name, value, said)


# -- every field of every class that validates

GIVEN = {
    fg.Box: {"x": 0.0, "y": 0.0, "length": 1.0, "width": 1.0}, fg.Cylinder: {"x": 0.0, "y": 0.0, "radius": 0.2},
    fg.Prism: {"footprint": ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))},
    fg.MovingObstacle: {"length": 0.4, "width": 0.3, "start": (6.0, 0.0), "end": (1.0, 0.0), "speed": 1.3},
    fg.Patch: {"x": 0.0, "y": 0.0, "length": 1.0, "width": 1.0, "mu": 0.5},
    fg.DriveCommand: {"steering_angle": 0.0, "speed": 1.0}, PlannerContext: {"car": CAR, "mu": MU, "max_speed": 8.0},
    Walls: {"room": 5.0, "gap": 0.1}, Relief: {"heights": np.zeros((2, 2))},
    CarParameters: dataclasses.asdict(CAR), MagicFormula: {"B": 10.0, "C": 1.6, "D": 1.1},
    **{kind: {"D": 1.0, "stiffness": 20.0} for kind in (Brush, Coulomb, Linear)},
}  # fmt: skip
"""What makes one of each class that cannot be made of nothing."""
INNER = {"OpenGround", "Stage", "WorldCar", "Tires", "DriveSettings", "Scenario", "EnvironmentSettings",
         "Sensor"}  # or see below
JUDGED_LATER = {"line", "controller", "track", "entries", "kind", "obstacles"}  # when it is used
OF_PLANNERS_THEMSELVES = {"car", "seed", "map_line", "sensors", "lidar", "assist"}  # of PlannerContext


CLASSES = {
    kind: given
    for package in (fg, fg_mujoco.controllers)
    for kind, given in classes_that_validate(package, GIVEN).items()
    if kind.__name__ not in INNER
}


def no_values_of(kind, field):
    """Values that a field cannot have, by its type."""
    numeric = re.search(r"\b(float|int)\b", str(field.type)) and "tuple" not in str(field.type)
    at_least_0 = kind.__name__.endswith("Settings") and kind.__module__.startswith("fg_mujoco.controllers")
    return (math.nan, "no such word", *((True, [], {}, np.zeros(3)) if numeric else ()), *((-1.0,) * at_least_0))


@each("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_a_value_that_no_field_can_have_is_refused_by_name(kind):
    assert len(CLASSES) > 50
    later = JUDGED_LATER | (OF_PLANNERS_THEMSELVES if kind is PlannerContext else set())
    for field in fields(kind):
        for value in no_values_of(kind, field) if field.init and field.name not in later else ():
            if field.name != "name" or value != "no such word":
                check(field.name, value, lambda f=field, v=value: kind(**CLASSES[kind] | {f.name: v}))


TOGETHER = {MagicFormula: ("B", "C", "D", "E"), MANOEUVRES["sine_sweep"]: ("low", "high")}
"""Fields whose bounds others set."""


@each("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_a_bound_that_a_refusal_names_is_where_refusals_begin(kind):
    assert_bounds(kind, CLASSES[kind], TOGETHER.get(kind, ()))


@each(
    ("made", "values", "said"),
    [
        (WeightedGapSettings, {"field_of_view": 3.2}, "field_of_view is 3.2; accepted: a number above 0, at most pi"),
        (DrivingSettings, {"safe_distance": 1.0, "full_speed_distance": 0.5}, "accepted: a number above safe_"),
        (fg.MovingObstacle, {"end": (6.0, 0.0)}, "accepted: "),
        (MANOEUVRES["circle"], {"radius": 0}, "Circle.radius is 0; accepted: a radius in metres other than 0"),
        (MANOEUVRES["slalom"], {"gates": 2.5}, "Slalom.gates is 2.5; accepted: a whole number from 3 to 1000"),
        (MANOEUVRES["sine_sweep"], {"high": 30}, "accepted: a frequency above low, 0.2 Hz, up to 10 Hz"),
        (SENSORS.find("imu"), {"name": "a/b"}, "Imu.name is 'a/b'; accepted: letters"),
        (SENSORS.find("pose"), {"noise_std": [1, 2]}, "accepted: a number from 0, or one for each of x_m, y_m"),
        (SENSORS.find("mid360"), {"rate": 20.0}, "Mid360.rate is 20.0; accepted: 10"),
        (LabSettings, {"mus": (0.5, 0.5)}, "each once"), (LabSettings, {"steerings": (0.0,)}, "angles above 0"),
    ],
)  # fmt: skip
def test_a_value_that_others_forbid_is_refused(made, values, said):
    with pytest.raises(fg.FgMujocoError, match=re.escape(said)) as refusal:
        made(**GIVEN.get(made, {}) | values)
    assert "accepted: " in str(refusal.value) or "each once" in said


# -- words: each that a registry has, with a letter missing

WORDS = {
    "track": track_names(), "vehicle": fg.vehicle_names(), "tires": tire_names(), "controller": controller_names(),
    "sensors": tuple(SENSORS), "lidar": ("raycast", "rangefinder", "mid360"),
    "grid": ("staggered", "side_by_side", "behind"), "rules": ("roboracer_2026", "autodrive_2026"),
}  # fmt: skip


def without_a_letter(word):
    return word[: len(word) // 2] + word[len(word) // 2 + 1 :]


@each("name", WORDS)
def test_a_word_that_lacks_a_letter_is_answered_with_the_word_at_every_door(name, here, capsys):
    for word in WORDS[name]:
        if len(word) < 5 or re.search(r"\d", word[-2:]):  # too short to say anything, or one of a family
            continue
        near = without_a_letter(word)
        meant = re.escape(f"did you mean {word!r}?")
        with pytest.raises(fg.FgMujocoError, match=meant):
            fg.race(Setup.of(**{name: [near] if name == "sensors" else near}), time_limit=0.01)
        assert re.search(meant, refused(here, capsys, "race", f"--{name}", near))
        (here / "race.toml").write_text(f"{name} = {json.dumps([near] if name == 'sensors' else near)}\n")
        assert re.search(meant, refused(here, capsys, "race", "--config", "race.toml"))


DOORS_OF_PYTHON = {
    "race": lambda **given: fg.race("oval", **given), "rollout": lambda **given: fg.rollout("oval", n=1, **given),
    "compare": lambda **given: fg.compare("gap_finder", track="oval", out="nowhere", **given),
    "drive": lambda **given: fg.drive("brake", **given), "Setup": Setup.of,
    "an environment": lambda **given: EnvironmentSettings.of(given),
}  # fmt: skip


@each("door", DOORS_OF_PYTHON)
def test_a_keyword_that_lacks_a_letter_is_answered_with_the_keyword(door, here):
    for name in ("time_limit", "vehicle", "changes", "tires"):
        with pytest.raises(fg.FgMujocoError, match=f"did you mean '{name}'") as refusal:
            DOORS_OF_PYTHON[door](**{without_a_letter(name): 2.0})
        assert door.split()[-1] in str(refusal.value) and "\n" not in str(refusal.value)
    assert not list(here.iterdir())


def test_a_key_an_option_and_a_command_that_lack_a_letter_are_answered_with_it(here, capsys):
    commands = _parser()._subparsers._group_actions[0].choices
    for command in commands:
        if len(command) > 4:
            assert f"did you mean {command!r}?" in refused(here, capsys, without_a_letter(command))
    commands["race"].fill()
    for option in [o for action in commands["race"]._actions for o in action.option_strings if len(o) > 7]:
        near = without_a_letter(option)
        assert re.search(rf"did you mean '{option}", refused(here, capsys, "race", f"{near}=1")), near
    for name in sorted(set(SETUP_KEYWORDS) - {"name", "entries", "controller", "effects"}):
        if len(name) > 5:
            (here / "race.toml").write_text(f"{without_a_letter(name)} = 1\n")
            assert "did you mean '" in refused(here, capsys, "race", "--config", "race.toml")


def test_wrong_arguments_of_all_that_is_public_are_refused_in_one_line():
    refused_by = set()
    for name in fg.__all__:
        found = getattr(fg, name)
        if not callable(found) or getattr(found, "_is_protocol", False) or name.endswith("Error"):
            continue
        kind, said = (ArgumentError, f"^{name} has no argument 'nonsense'")
        if name == "parallel_env":  # whose settings are those of environments
            kind, said = fg.SettingsError, "^an environment has no setting 'nonsense'"
        with pytest.raises(kind, match=said) as caught:
            found(nonsense=1)
        assert "\n" not in str(caught.value)
        refused_by.add(name)
    assert issubclass(ArgumentError, TypeError)
    assert {"race", "rollout", "compare", "load_track", "DriveCommand", "Patch", "World", "Entry"} <= refused_by


def test_a_name_that_resembles_nothing_gets_no_hint_and_a_part_of_one_is_that_one():
    assert accepted_names("zzz", ("oval", "tight"), ", or FILE") == "accepted: oval, tight, or FILE"
    assert accepted_names("ovel", ("oval", "tight")) == "accepted: oval, tight; did you mean 'oval'?"
    assert accepted_names(3.5, ("oval",)) == "accepted: oval"
    tires = ("contact", "forzaeth_nuc5", "forzaeth_nuc6", "forzaeth_sim")
    assert nearest("nuc5", tires) == "forzaeth_nuc5"
    assert nearest("nuc", tires) is nearest("im", tires) is None  # two, and too short to say anything


@each("given", [given for given in GONE if " " in given])
def test_what_went_is_refused_with_what_serves_instead(given, here, capsys):
    setting, words = given.removeprefix("setting "), given.removeprefix("fg-mujoco ").split()
    words = words if setting == given else ("race", "--controller", f"gap_finder[{setting}=1]")
    assert f"{given!r} is gone; instead: {GONE[given]}" in refused(here, capsys, *words)


def test_python_refuses_what_went_in_the_same_words():
    with pytest.raises(ArgumentError) as refusal:
        fg.race("oval", trust=True)
    assert str(refusal.value).endswith(f"'--trust' is gone; instead: {GONE['--trust']}")
    with pytest.raises(AttributeError) as refusal:
        fg.overtake  # noqa: B018
    assert str(refusal.value).endswith(GONE["fg-mujoco overtake"])


# -- what several settings together cannot be, and what is meant by other words

LINES = {
    "": "race, replay, drive, track, controllers", "fly": "race", "run oval": "`fg-mujoco race` runs a race",
    "tracks": "`fg-mujoco track list` lists the circuits", "--map my.yaml": "accepted: fg-mujoco COMMAND --map",
    "train": "required: --out", "track": "new, show, from-image, list", "track ls": "did you mean 'list'?",
    "race --map my.yaml": "did you mean '--track'?", "race --speed 4": "did you mean '--max-speed'?",
    "race --planner gap_finder": "did you mean '--controller'?", "race --gui": "`fg-mujoco view` shows a race",
    "race oval": "did you mean '--track oval'?", "race mine.py:P": "did you mean '--controller mine.py:P'?",
    "race --laps=abc": "'abc'; accepted: a whole number", "race --track random:7:tigth": "'random:7:tight'",
    "race --controller mine.py:planner": "'Planner'",
    "race --track line.csv[width=2,direction=clokwise]": "'clockwise'",
    "race --track scene:nowhere": "unknown scene 'scene:nowhere'; accepted: corridor_sparse,",
    "race --track scene:dead_end:x": "accepted: scene:NAME:SEED", "race --track scene:dead_end --laps 3": "accepted: 1",
    "race --track scene:dead_end --obstacles 3": "accepted: on a track",
    "race --lidar rangefinder --motion-distortion --out run": "raycast", "race --obstacles -1": "from 0",
    "replay": "DIR", "replay nowhere": "summary.json", "replay --seed 3 runs/x": "'--seed' is no option here;",
    "track new out.csv": "--seed", "track new --seed x out.csv": "SEED", "track show hairpin": "'hairpins'",
    "track new --seed 1 nowhere/out.csv": "cannot be written", "track show oval --out oval.csv": ".png",
    "track show oval --out nowhere/oval.png": "cannot be written",
    "vehicles nuc": "'nuc2'", "controllers follow_gap": "'follow_the_gap'",
    "rollout --n 1 --record sumary": "'summary'", "rollout --record states": "--record states is kept nowhere",
    "rollout --randomize mu": "--randomize 'mu'; accepted: NAME=RANGE, as mu=0.6:1.2",
    "rollout --randomize mu=1 --randomize mu=2": "accepted: mu once",
    "rollout --randomize obstacles=500": "accepted: at most", "rollout --n 1 --randomize planer_mu=1": "'planner_mu'",
    "rollout --n 1 --randomize planner.lookahed=1:2": "'lookahead'",
    "compare --out out --controller gap_finder,gapfindr": "'gap_finder'", "render run --camera chas": "'chase'",
    "export run --format mcp": "'mcap'", "replay-scans a.mcap --controller gap_findr": "'gap_finder'",
    "friction skidpad --mu 0.5,0.5": "each once", "friction skidpad --mu 0.5,": "accepted: a number",
    "friction skidpad --steering 0.1,0.5": "the car's lock of 0.4189 rad", "friction skidpd": "'skidpad'",
    "friction skidpad --mu 0.5:0.3": "LOW below HIGH",
    "friction skidpad --mu .5 --floor ipz8": "the floor sets one, too", "friction skidpad --law limit": "'limiter'?",
    "friction laps --steering 0.1": "--steering with laps; accepted: with skidpad, sets, ground, step, braking, or all",
    "friction step --track oval": "with laps, mismatch, or all", "friction sets --tires ipz": "with skidpad, ground,",
    "friction step --controller random": "--controller with step; accepted: with laps,",
    "friction braking --law field": "--law with braking", "friction laps --track hairpin": "'hairpins'",
    "drive": "drive has no commands; accepted: step_steer", "drive circl": "did you mean 'circle'?",
    "drive circle[radios=2]": "has no setting 'radios'", "drive circle[radius=2": "NAME[SETTING=VALUE",
    "drive circle[radius=0.5]": "steers up to 0.5837 rad; accepted: up to the car's 0.4189 rad",
    "drive circle[radius=wide]": "Circle.radius is 'wide'", "drive circle[turns=1e9]": "accepted: up to 600 s",
    "drive brake --speed 30": "--speed is 30.0; accepted: up to the car's 20 m/s", "drive .": "unknown manoeuvre '.'",
    "drive brake[speed=2] --speed 3": "--speed is 3.0, and in the brackets of 'brake[speed=2]' there is one",
}  # fmt: skip


@each("line", LINES)
def test_the_command_line_says_what_is_accepted_or_was_meant(line, here, capsys):
    (here / "line.csv").write_text("0,0\n10,0\n10,10\n0,10\n")
    (here / "mine.py").write_text("class Planner:\n    def reset(self): pass\n    def __call__(self, a, b): pass\n")
    assert LINES[line] in refused(here, capsys, *line.split())


def environment(**settings):
    gym_environment = pytest.importorskip("fg_mujoco.envs.gym_environment", exc_type=ImportError)
    return gym_environment.F1TenthEnv(beam_step=540, **settings)


def rollout(track="oval", **settings):
    return fg.rollout(track, **{"n": 1, "time_limit": 0.1, "out": "out"} | settings)


NOISE, FAST = fg.LidarEffects(range_noise_std=0.02, latency=0.03), {"mu": 0.8, "changes": fg.CarChanges(mu=0.5)}
TWICE = r"mu is 0\.8 and CarChanges\.mu is 0\.5; accepted: one of them"
IN_BRACKETS = {"controller": "gap_finder[lookahead=6]", "planner_settings": {"lookahead": 6.0}}
NOT_ON_COURSE = [Start(offset=3.0), Start(offset=1.1), Start(s=20.0, offset=-40.0)]  # the oval is 2.2 m wide


def stepped(action, **settings):
    """Step an environment that refuses it, and has driven nothing then."""
    env = environment(**settings)
    env.reset(seed=0)
    try:
        env.step(action)
    finally:
        if not settings:
            assert env.step(np.zeros(2))[4]["time_s"] == pytest.approx(0.025)


CALLS = {
    "actions": [
        *((lambda a=action: stepped(a), said) for action, said in (
            ([math.nan, 1.0], "steering_angle is nan"), ([0.0, math.nan], "speed is nan"), ([0.0], "shape"),
            ("ab", "accepted"))),
        *((lambda a=answer: stepped(np.zeros(2), opponents=[lambda seen: a]), said) for answer, said in (
            (None, "the policy of opponent 1.*accepted"), ("ab", "opponent 1 answered 'ab'; accepted: an action"),
            ([0.0, math.nan], "the policy of opponent 1: .*speed is nan"))),
        *((lambda c=command: fg.Simulation(fg.World("oval")).step(c), r"accepted: a DriveCommand\(steering_angle=0.1")
          for command in ((0.0, 1.0), np.zeros(2), None)),
    ],
    "calls": [
        (lambda: fg.race("oval", planner="gap_finder"), "did you mean 'controller'"),
        (lambda: fg.race("oval", speed=4), "did you mean 'max_speed'"),
        (lambda: fg.race("oval", gui=True), "`fg-mujoco view` shows a race as it goes"),
        (lambda: fg.race("oval", out="x"), r"write_run\(result, DIR\) writes a run folder"),
        (lambda: fg.race("oval", "gap_finder", 3), r"accepted: 2 at most, as in race\(track, controller\)"),
        (lambda: fg.race(), r"race lacks track; accepted: race\(track, controller\)"),
        (lambda: fg.rollout("oval", worlds=2), "did you mean 'n'"),
        (lambda: fg.load_track("oval", cars=3), "did you mean 'car'"),
        (lambda: fg.LidarEffects(noise=0.1), "did you mean 'range_noise_std'"),
        (lambda: fg.DriveCommand(0.1, 1.0), r"accepted: none, as in DriveCommand\(steering_angle=..., speed=...\)"),
        (lambda: fg.DriveCommand(speed=1.0), "lacks steering_angle"),
        (lambda: fg.Patch(x=1.0), "Patch lacks y, length, width, mu"),
        (lambda: fg.race("oval", Straight, time_limit=0.1), r"accepted: an object of it, such as Straight\(\)"),
        (lambda: fg.make_controller("gap_finder", car=CAR, mu=1.0, max_speeed=8.0), "did you mean 'max_speed'"),
        (lambda: fg.make_controller("gap_finder", car=CAR), "lacks mu, max_speed"),
    ],
    "words": [
        (lambda: fg.World("oval", "nuc"), "'nuc2'"), (lambda: load_experiment("skid_pad"), "'skidpad'"),
        (lambda: fg.race("oval", planner_settings={"lookahed": 2.0}), "'lookahead'"),
        (lambda: rollout(randomize={"cog_heigth": 0.1}), "'cog_height'"), (lambda: rollout(record="state"), "'states'"),
        (lambda: fg.LidarEffects(no_return="range-max "), "'range_max'"),
        (lambda: LidarModel.load().beams.to_scan(np.zeros(1), 0.0, no_return="range_mx"), "'range_max'"),
        (lambda: find_camera("orbital"), "'orbit'"), (lambda: find_overlays("chase", beam=True), "'beams'"),
        (lambda: Rewards.of("noslide"), "'no_slide'"),
    ],
    "given twice": [
        *((lambda door=door: door(**FAST), TWICE) for door in (Scenario, Setup.of, EnvironmentSettings, rollout)),
        (lambda: Setup.of(mu=0.5, changes={"mu": 0.6}), "accepted: one of them, or the same twice"),
        (lambda: Setup.of(entries=[fg.Entry()], mu=0.5), "mu is 0.5 together with entries; accepted: mu of each Entry"),
        (lambda: Setup.of(entries=[fg.Entry()] * 2, opponents=["gap_finder"]), "accepted: a list, without other"),
        (lambda: Setup.of(lidar_noise=0.1, effects=fg.LidarEffects()), "lidar_noise and effects are given"),
        (lambda: fg.race("oval", **IN_BRACKETS), "lookahead is given in the brackets of .* and in planner_settings"),
        (lambda: rollout(**IN_BRACKETS), "lookahead is given in the brackets of .* and in planner_settings"),
        *((lambda f=fixed, d=drawn: rollout(randomize={d: (0.9, 1.0)}, **f), f"{drawn} is given for all worlds and in")
          for drawn, fixed in {
              "mu": {"mu": 0.8}, "mass": {"changes": fg.CarChanges(mass=4.0)}, "planner_mu": {"planner_mu": 1.0},
              "max_speed": {"max_speed": 5.0}, "start_speed": {"start": Start(speed=1.0)},
              "lidar_noise": {"effects": NOISE}, "planner.lookahead": {"planner_settings": {"lookahead": 6.0}},
          }.items()),
    ],
    "together": [
        (lambda: Setup.of(grid="side_by_side"), "grid is 'side_by_side' without opponents"),
        (lambda: Setup.of(rules="roboracer_2026"), "rules is 'roboracer_2026' without opponents"),
        (lambda: Setup.of(obstacles=[{"kind": "cube"}]), r"obstacles\[0\].kind is 'cube'; accepted: box, cylinder"),
        (lambda: GapFinder(CAR, math.inf, assist="none,sight"), "sight, which needs a friction limit, and mu is inf"),
        *((lambda assist=assist: GapFinder(CAR, MU, assist=assist), said) for assist, said in {
            "fulll": "is 'fulll'; accepted: none, grip, .*did you mean 'full'", "full,": "there is no stage ''",
            "full,creeep": "there is no stage 'creeep'; accepted: .*, or several", "sight+sight": "has sight twice",
            "prediction": "has prediction, which needs safety_filter; accepted: prediction.safety_filter",
            "full-limiter": "has guidance, which needs limiter",
        }.items()),
        (lambda: fg.race("oval", sensors="imu"), r"sensors is 'imu'; accepted: a sequence of sensors"),
        (lambda: fg.race("oval", sensors=[{"rate": 3}]), r"accepted: a Sensor, its name, or \{'sensor': NAME\}"),
        (lambda: fg.race("oval", sensors=[{"sensor": "imu", "rte": 3}]), "did you mean 'rate'"),
        (lambda: fg.race("oval", sensors=["imu", {"sensor": "pose", "name": "imu"}]), "two of the name 'imu'"),
        (lambda: fg.race("oval", sensors=[{"sensor": "imu", "rate": 33}]), "accepted: 200 Hz over a whole number"),
        *((lambda s=start: fg.race("oval", start=s), "the car does not fit on 'oval' at s = .*(beyond the|in a) wall")
          for start in NOT_ON_COURSE),
        *((lambda b=size: fg.race("oval", obstacles=(fg.Box(x=0.0, y=0.0, length=b, width=b),)), "an obstacle")
          for size in (0.3, 1.6)),  # the car stands within the larger one and touches no side
        (lambda: rollout(start=NOT_ON_COURSE[0]), "the car does not fit on "),
    ],
    "rollouts": [
        (lambda: rollout(n=None, seeds=[]), "seeds are not"),
        (lambda: rollout(n=3, seeds=[1, 2]), "n is 3 and there are 2 seeds"), (lambda: rollout([]), "no track"),
        (lambda: rollout(randomize={"mass": (0.1, 4)}), "randomize mass=0.1:4.0"),
        (lambda: rollout(randomize={"obstacles": "0:900"}), "randomize obstacles=900 on 'oval'; accepted: at most"),
        (lambda: rollout(controller=Straight()), "Straight object|is an object; accepted: a name or path"),
        (lambda: rollout("scene:dead_end", laps=2), "laps is 2 on 'scene:dead_end:0'.*accepted: 1"),
        (lambda: rollout("scene:dead_end", randomize={"obstacles": 2}), "which has its own; accepted: on a tr"),
        (lambda: rollout("scene:dead_end", randomize={"start_s": (0.0, 90.0)}), "accepted: from 0 to less"),
        *((lambda ranges=ranges: Randomization.of(ranges), said) for said, ranges in {
            "friction: no parameter; accepted: mu,": {"friction": "1:2"}, "'low'; accepted: a number": {"mu": "low:2"},
            "accepted: finite LOW:HIGH, LOW first": {"mu": "1.2:0.6"}, "accepted: finite LOW:HIGH": {"mu": "0.5:inf"},
            "accepted: numbers": {"mu": "nan"}, "CarChanges.mu is -0.5; accepted: a positive": {"mu": "-0.5:1"},
            "accepted: 0 to 0.15 s": {"command_delay": "0:1"}, "planner_mu is 0.0": {"planner_mu": "0:1"},
            "Start.s is 'x'": {"start_s": "1|x"}, "accepted: whole numbers from 0": {"obstacles": "0:2.5"},
            "accepted: whole numbers from 0 to 1000": {"obstacles": "0:1e12"},
        }.items()),
    ],
    "opponents": [
        *((lambda door=door, given=given: door(**given), said)
          for door in (rollout, lambda **given: fg.compare("gap_finder", track="oval", out="out", **given))
          for said, given in {
              "car_1: controller 'nope' is not known": {"opponents": ["nope"]},
              "car_1: .* has no setting 'nope'": {"opponents": ["gap_finder[nope=1]"]},
              "is an object": {"opponents": [fg.Entry(controller=lambda scan, odometry: None)]},
              "17 entries; accepted: 1 to 16": {"opponents": ["gap_finder"] * 16},
              "two entries are called 'a'": {"opponents": [fg.Entry(name="a"), fg.Entry(name="a")]},
              "'car_1' and 'car_0' start in one place": {"opponents": [fg.Entry(start=Start(s=0.1))]},
              "'car_1' does not fit on 'oval'": {"opponents": [fg.Entry(start=Start(s=5.0, offset=2.0))]},
          }.items()),
        (lambda: environment(opponents=[Straight()]), "opponent 1 is .*Straight.*accepted: a planner's name"),
        (lambda: environment(opponents=[len, "no.py:No"]), "opponent 2: .*there is no file no.py"),
        (lambda: environment(opponents=["gap_finder[lookahed=3]"]), "opponent 1: .*did you mean 'lookahead'"),
        (lambda: environment(opponents=[{"controler": "gap_finder"}]), "opponent 1 has no setting 'controler'"),
        (lambda: environment(opponents=[len] * 16), "17 cars in a world; accepted: up to 16"),
    ],
    "environments": [
        (lambda: environment(randomize={"mu": (0.5, 9.0)}), "randomize mu=0.5:9.0: CarChanges.mu is 9.0"),
        (lambda: environment(randomize={"planner_mu": (0.5, 1.0)}), "a policy drives in the planner's place"),
        (lambda: environment(randomize={"opponent": ["gap_finder"]}), "it has no opponents"),
        (lambda: environment(randomize={"patches": (0, 3)}), "without patch_mu"),
        (lambda: environment(randomize={"mu": (0.5, 1.0)}, mu=0.7), "mu is given for all worlds and in randomize"),
        (lambda: environment(track=["oval", "ovall"]), "unknown track 'ovall'; accepted: .*did you mean 'oval'"),
        (lambda: environment(track=["oval", "random:9:9"]), "accepted: random:A:B with A below B"),
        *((lambda given=given: Rewards.of(given), "accepted: ")
          for given in ({"preset": 3}, {"preset": "no_slid"}, {"bounded": 1}, 3)),
    ],
}  # fmt: skip


@each("kind", CALLS)
def test_a_call_is_refused_before_anything_is_driven(kind, here):
    for number, (call, said) in enumerate(CALLS[kind]):
        with pytest.raises(fg.FgMujocoError) as refusal:
            call()
        text = str(refusal.value)
        assert re.search(said, text), (number, said, text)
        assert "\n" not in text, (number, text)
    assert not list(here.iterdir())


# -- every setting x value x door

NUMBER = (math.nan, "many", True, [], {}, np.zeros(3))  # is none of a setting
WHOLE = (*NUMBER, -1, 0.5, math.inf)
POSITIVE = (*NUMBER, 0.0, -1.0)
BAD = {
    "laps": (*WHOLE, 0, 10**9), "seed": WHOLE, "obstacle_seed": WHOLE, "obstacles": (math.nan, "many", {}, -1, 0.5),
    "time_limit": (*POSITIVE, math.inf, 1e9), "decision_limit": (*POSITIVE,), "mu": (*POSITIVE, math.inf, 50.0),
    "planner_mu": (*POSITIVE, -math.inf, 50.0), "max_speed": (*POSITIVE, math.inf, 1e9),
    "odometry_drift": (*NUMBER, math.inf, 3.0), "lidar": ("sonar", 3, []), "track": ({}, 3, b"x", "open_ground:x"),
    "vehicle": ("nobody", 3, []), "tires": ("rubber", 3), "floor": ("ice", 3), "knows": ("all", 3),
    "odometry": ("gps", 3), "pose": ("gps", "", "rate=ten", "drift=-1", "jumps=1", {"rat": 10}, {"drift": [1.0]}, 3),
    "assist": ("some", "", 3, "full,full"),
    "sensors": (3, ["eye"]),
    "controller": (3, []), "grid": ("round", 3), "rules": ("roborace", 3), "opponents": ("gap_finder", [3], 3),
    "entries": ([], ["gap_finder"], 3), "moving": ("dragon:1", 3), "name": (3, ""),
    "patches": ([{"x": 1}], [{"x": 1, "lenght": 2}], [(1, 0, 2, 1, 0.4)], {"x": 1}, 5), "changes": ({"weight": 4.0}, 3),
    "planner_settings": ({"lookahed": 2.0}, 3), "start": ({"sped": 1.0}, {"s": math.nan}, "here", 3.0),
    "effects": ({"range_noise": 0.1}, 3), "lidar_effects": ({"range_noise": 0.1}, 3),
    "lidar_noise": (*NUMBER, -0.1, 50.0), "lidar_dropout": (*NUMBER, -0.1, 1.5),
    "lidar_latency": (*NUMBER, -1.0, 100.0),
    "motion_distortion": (3, "yes"), "start_s": NUMBER, "start_offset": NUMBER, "start_heading": NUMBER,
    "floor_angle": (*NUMBER, -0.1, 2.0), "through_cars": (*NUMBER, -0.1, 1.5),
    "start_speed": NUMBER, "mass": (*POSITIVE,), "cog_height": (*POSITIVE,), "steering_gain": (*POSITIVE,),
    "speed_gain": (*POSITIVE,), "command_delay": (*NUMBER, -0.1, 1.0),
}  # fmt: skip
OF_ENVIRONMENTS = {
    "beam_step": (*WHOLE, 0, 541), "speed_range": ((0.0, 21.0), (3.0, 3.0), 3.0), "normalised_actions": (1, "yes"),
    "action_repeat": (*WHOLE, 0), "smoothing": (-1.0, True, "much"), "grid_order": ("upside_down", 3),
    "on_contact": ("bounce", 3), "ended_by": ("none", 3),
    "camera": ("64", "8x8", "2049x64", 3, "64x48:side", None),
    "builds": (0, 0.5),
    "rewards": (3, {"colision": 1.0}, {"collision": -1.0}, {"lap": math.nan}, {"my": (3.0, 1)}, {"lap": (len, 1.0)}),
    "end_conditions": ("turned_round", ["turned"], [len], ["turned_round"] * 2),
    "observation": (
        3, [], ["scam"], ["scan", "scan"], "beams", "beams:2000", "speed:late=3", "speed:delay=9", "speed:noise=-1",
        "speed:max=3", "speed:every=4", "speed:history=100:every=20",
        *([ObservationTerm(name="mine", function=len, bounds=bounds)] for bounds in ((1.0, 1.0), (0.0, math.inf))),
    ),
    "action": (3, "speed,steering"), "randomize": ([0.5], {"mue": (0.5, 1.0)}), "privileged": ("speed",),
    "render_mode": ("ansi",),
}  # fmt: skip
UNBOUNDED = {("laps", 10**9), ("time_limit", 1e9)}  # in an environment, which keeps nothing of its ticks


def test_every_setting_is_here():
    assert set(SETUP_KEYWORDS) == set(BAD)
    made = {field.name for field in fields(EnvironmentSettings)} - set(BAD)
    assert made - set(OF_ENVIRONMENTS) <= {"residual", "build_seed", "setup"}


@each("name", sorted(BAD))
def test_a_race_refuses_it(name):
    for value in BAD[name]:
        check(name, value, lambda value=value: fg.race(Setup.of(**{name: value}), time_limit=0.01))


@each("name", sorted(BAD | OF_ENVIRONMENTS))
def test_an_environment_refuses_it(name):
    environment = pytest.importorskip("fg_mujoco.envs.gym_environment", exc_type=ImportError).F1TenthEnv
    for value in (BAD | OF_ENVIRONMENTS)[name]:
        if not isinstance(value, (int, float)) or (name, value) not in UNBOUNDED:
            check(name, value, lambda value=value: environment(**{name: value}))


def options_of(command):
    return {each.dest for each in _parser(command)._subparsers._group_actions[0].choices[command]._actions}


def texts_of(command):
    """The options of a command, with their bad values that are texts; 3 may be the path of a planner or a track."""
    names = options_of(command) & set(BAD) - {"opponents"} - ({"controller", "track"} if command == "view" else set())
    return {
        name: [f"{each}" for each in BAD[name] if isinstance(each, (int, float, str)) and each is not True]
        for name in sorted(names)
    }


DOORS = {"race": (), "rollout": ("--n", "1"), "compare": ("--out", "out"), "view": ("--web",)}
OF_COMMANDS = {
    ("rollout", "--n=1"): {
        "n": ("0", "-5"), "workers": ("0",), "memory-budget": ("-1",), "chunk": ("0",), "record": ("all",),
        "executor": ("dask",), "randomize": ("mu=0.5:50", "mu=-1:1", "lidar_noise=99", "speed=1"),
    },
    ("compare", "--out=out", "--track=oval", "--controller=gap_finder"): {"seed": ("-1", "1,-4"), "workers": ("0",)},
    ("view", "--web"): {"port": ("0", "99999999")},
    ("friction", "skidpad"): {"mu": ("0", "50", "1:"), "steering": ("0", "9"), "law": ("no.py:f",), "workers": "0"},
    ("render", "run"): {"camera": ("drone",), "quality": ("ultra",), "size": ("big",)},
    ("track", "export", "oval", "oval.yaml"): {"resolution": ("0", "-1", "1e-9")},
}  # fmt: skip
"""What commands take besides settings, with values that none takes."""


@each("door", DOORS)
def test_the_command_line_refuses_it_by_its_option(door, tmp_path, monkeypatch, capsys):
    if door == "view":
        pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    monkeypatch.chdir(tmp_path)
    for name, values in texts_of(door).items():
        option = f"--{name.replace('_', '-')}"
        for value in values:
            said = refused(tmp_path, capsys, door, *DOORS[door], f"{option}={value}")
            assert name in said or option[2:] in said or NAMES.get(name, name) in said, (name, value, said)
            assert "Settings." not in said and "LidarEffects." not in said and "CarChanges." not in said


@each("command", OF_COMMANDS, ids=" ".join)
def test_a_command_refuses_it_by_its_option(command, tmp_path, monkeypatch, capsys):
    if command[0] == "view":
        pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    monkeypatch.chdir(tmp_path)
    for name, values in OF_COMMANDS[command].items():
        for value in values:
            said = refused(tmp_path, capsys, *command, f"--{name}={value}").split(": ", 1)[1].removeprefix("argument ")
            assert said.startswith((f"--{name} is ", f"--{name}: ", f"--{name} ")) and "accepted: " in said, value


def toml_of(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml_of(part)}" for key, part in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml_of, value)) + "]"
    return json.dumps(value).replace("NaN", "nan").replace("Infinity", "inf")


def test_a_file_of_settings_refuses_it_with_its_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in BAD.keys() - {"controller", "planner_settings"}:  # which the planner refuses, not the file
        for value in BAD[name]:
            if not isinstance(value, (np.ndarray, bytes)):
                (tmp_path / "race.toml").write_text(f"# settings\n{name} = {toml_of(value)}\n")
                said = refused(tmp_path, capsys, "race", "--config", "race.toml")
                line = "" if isinstance(value, dict) else ", line 2"
                assert f"race.toml{line}: " in said.replace(", line 2", line) and "accepted: " in said, (value, said)


def test_a_message_about_something_else_keeps_its_words(tmp_path, capsys):
    (tmp_path / "planner.py").write_text(
        "from fg_mujoco.messages import *\nclass P:\n    def reset(self): pass\n"
        "    def __call__(self, scan, odometry): return DriveCommand(steering_angle=0.0, speed=float('nan'))\n"
    )
    assert main(["race", "--controller", f"{tmp_path / 'planner.py'}:P"]) == 1
    assert "DriveCommand.speed is nan" in capsys.readouterr().err
