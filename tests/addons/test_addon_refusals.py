"""What add-ons refuse: in one line that names it and what is accepted, before anything runs or is written.

The fields come from the dataclasses of the add-ons, so that a new one is tried without a word here. `LINES`, `SUITES`
and `CALLS` have what is refused for what else is there, by add-on. What needs a file, a wire or a state of its own, a
torn bag, a policy that does not fit or a peer that misbehaves, stands in the file of that.
"""

import dataclasses
import importlib.util
import math
import re
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
import fg_mujoco.addons
from bag_worlds import robot_scan, rotation
from cases import each
from comparison_worlds import SUITE
from fg_mujoco.addons import gym2d as f110
from fg_mujoco.addons.arena.race_control.fault import Approach
from fg_mujoco.addons.arena.random_courses.generator import GeneratorSettings
from fg_mujoco.addons.arena.runs.checks import CHECKS
from fg_mujoco.addons.arena.runs.duels import Duels
from fg_mujoco.addons.gym2d import gym_config
from fg_mujoco.addons.learn.dataset import require_minari
from fg_mujoco.addons.learn.onnx_policy import require_onnx, require_onnxruntime
from fg_mujoco.addons.learn.ray_cluster import require_ray
from fg_mujoco.addons.learn.residual import Residual
from fg_mujoco.addons.learn.training_settings import TrainingSettings
from fg_mujoco.addons.look.live.browser import require_viser
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.addons.realcar.floors import Floor
from fg_mujoco.addons.realcar.identification.fit import require_scipy
from fg_mujoco.addons.realcar.measured_errors import MeasuredErrors
from fg_mujoco.addons.ros.bag_frames import rotation as rotation_of
from fg_mujoco.addons.ros.bag_messages import require_ros_extra
from fg_mujoco.addons.ros.bag_scans import Mount, to_scan
from fg_mujoco.addons.servers.autodrive.devkit import split_address
from fg_mujoco.addons.servers.ros2.participant import require_cyclonedds
from fg_mujoco.course.maps.export import export_tracks
from fg_mujoco.envs.gym_environment import F1TenthEnv
from fg_mujoco.errors import FgMujocoError, install_command
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.resolved import ground_of
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.settings import known_settings
from refusals import assert_bounds, classes_that_validate, refused

# -- every field of every class that validates

GIVEN = {CHECKS["lap_time"]: {"most_s": 9.0}, CHECKS["mean_speed"]: {"least_m_s": 1.0},
    CHECKS["keeps_clear"]: {"least_m": 0.1}, CHECKS["follows_wall"]: {"distance_m": 1.0, "within_m": 0.2},
    CHECKS["stops_before"]: {"least_speed_m_s": 1.0}, CHECKS["stopping_distance"]: {"from_m_s": 1.0, "most_m": 1.0},
    Floor: {"name": "ice", "mu": 0.5}, Residual: {"planner": "gap_finder"}}  # fmt: skip
"""What makes one of each class that cannot be made of nothing."""
JUDGED_LATER = {(Residual, "planner"), (Duels, "speed")}


CLASSES = classes_that_validate(fg_mujoco.addons, GIVEN)


@each("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_a_bound_that_a_refusal_names_is_where_refusals_begin(kind):
    pairs = {field.name for field in dataclasses.fields(kind) if field.name.startswith(("max_", "least", "greatest"))}
    assert_bounds(kind, CLASSES[kind], pairs if kind in (Floor, GeneratorSettings) else ())


@each("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_a_value_that_no_field_can_have_is_refused_by_name(kind):
    assert len(CLASSES) > 15
    for field in dataclasses.fields(kind):
        numeric = re.search(r"\b(float|int)\b", str(field.type)) and "tuple" not in str(field.type)
        words = () if field.type == "str" else ("no such word",)
        words += (-1.0,) if ".drivers" in kind.__module__ and kind.__name__.endswith("Settings") else ()
        for value in (math.nan, *words, *((True, [], {}, np.zeros(3)) if numeric else ())):
            if field.init and (kind, field.name) not in JUDGED_LATER:
                with pytest.raises(FgMujocoError, match=rf"{field.name}.*accepted: ") as refusal:
                    kind(**GIVEN.get(kind, {}) | {field.name: value})
                assert "\n" not in str(refusal.value)


# -- lines of commands

BESIDE = "race --laps 1 --opponents wall_follow"
LINES = [
    # arena
    ("study small.toml gap_finder gap_finder", "planner gap_finder is given twice; accepted: one or more, each once"),
    ("study small.toml broken.py:Planner", "No module named 'nothing_there'"),
    ("bench straight --suite duels.toml", "suite duels is of duels; accepted: one of planners alone, for scores"),
    ("study small.toml gap_findr", "did you mean 'gap_finder'?"),
    ("race --laps 1 --opponents nobody", "car_1: controller 'nobody'"),
    (f"{BESIDE} --opponent-max-speed 1 --opponent-max-speed 2", "given 2 times for 1"),
    ("race --laps 1 --opponent-max-speed 1", "given 1 times for 0 opponents"),
    (BESIDE + 3 * " --opponent-vehicle nuc2",
     "--opponent-vehicle is given 3 times for 1 opponents; accepted: once, or once for each --opponents"),
    (BESIDE + 15 * " --opponents wall_follow", "17 entries; accepted: 1 to 16"),
    # learn
    ("train --out first --env trak=oval", "an environment has no setting 'trak'; accepted:"),
    ("train --out first --ppo gama=.9", "did you mean 'gamma'?"),
    ("train --out first --ppo gamma=2", "PPO.gamma is 2; accepted: a number from 0 to 1"),
    (f"train --out first --worlds {10**12}", "worlds is 1000000000000; accepted: a whole number from 1 to 65536"),
    ("train --out first --worlds 65536 --ppo n_steps=2000", "steps at most in an iteration"),
    (f"train --out first --ppo net={'9' * 400}", "accepted: whole numbers from -922"),
    ("train --out first --ppo minibatches=7", "minibatches is 7, of 32 worlds times 128 steps"),
    ("train --out first nothing.toml", "nothing.toml: there is no such file"),
    # look
    ("debug run --at 2.5", "accepted: 0 to 0.200 s"), ("debug run --at -1", "accepted: 0 to 0.200 s"),
    ("debug run --at nan", "accepted: 0 to 0.200 s"),
    ("debug run --window 0", "--window is 0; accepted: seconds above 0"),
    ("debug run --out no/folder/page.html", "cannot be written"), ("report nowhere", "summary.json"),
    ("report run --clip 0", "--clip"), ("report run --out page.txt", ".html"),
    ("report run --out no/such/folder/page.html --no-clip", "cannot be written"),
    # realcar
    ("identify nothing --out tires.toml", "nothing: cannot be read"),
    ("identify card --out tires.toml", "no summary.json"),
    ("identify run --out tires.txt", "tires.txt: is no name for a file of tires; accepted: one that ends in .toml"),
    ("identify run --out tires.toml --report page.pdf", "page.pdf: is no name for a page"),
    ("identify run --out tires.toml --vehicle nuc", "did you mean 'nuc2'?"), ("identify run", "--out"),
    # ros
    ("export run --format rosbag", "'rosbag'; accepted: mcap"), ("export run --out run.bag", "ends in .mcap"),
    ("export run --out nowhere/run.mcap", "cannot be written"),
    # servers
    *((f"serve autodrive --devkit={address}", "accepted: HOST or HOST:PORT, such as 127.0.0.1:4567")
      for address in ("", "127.0.0.1:", "127.0.0.1:0", "127.0.0.1:x", "127.0.0.1:70000", ":4567")),
    # all that write a file or a folder
    *((f"{line} taken{ending}", f"taken{ending}: exists; accepted: a new file, or --force")
      for line, ending in {
          "track show oval --out": ".png", "track new --seed 1": ".csv", "track export oval": ".yaml",
          "track convert line.csv": ".csv", "raceline oval --out": ".csv", "raceline oval --picture": ".png",
          "render run --frame 0 --out": ".png", "render run --out": ".mp4", "race --video": ".mp4",
          "report run --out": ".html", "debug run --out": ".html", "export run --out": ".mcap",
          "identify run --out": ".toml", "identify run --out tires.toml --report": ".html",
          "validate run --csv": ".csv", "validate run --report": ".html",
      }.items()),
    ("report run", "report.html: exists; accepted: a new file"),
    ("track from-image taken.png --resolution 1", "taken.yaml: exists; accepted"),
    *((f"{line} --out taken", "taken: ") for line in (
          "race", "bench straight", "car params.yaml", "friction skidpad", "rollout --n 2", "train",
          "compare --track oval", "study small.toml straight")),
    *((f"{line} --force", "is read by this command; accepted: another file") for line in (
          "track show taken.yaml --out taken.png", "track export taken.yaml taken.yaml",
          "track convert line.csv line.csv", "track export line.csv line.csv", "raceline line.csv --out line.csv",
          "raceline taken.yaml --picture taken.png",
          "identify run --out tires.toml --report taken.html --columns taken.html")),
]  # fmt: skip


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A folder with a run and with files that the lines name."""
    folder = tmp_path_factory.mktemp("filled")
    fg.write_run(fg.race("oval", time_limit=0.2), folder / "run", picture=False)
    (folder / "run" / "report.html").write_text("mine")
    export_tracks(fg.load_track("oval"), [folder / "taken.yaml", folder / "line.csv"])
    for name in ("taken", "taken.csv", "taken.mp4", "taken.html", "taken.mcap", "taken.toml"):
        (folder / name).touch()
    (folder / "card").mkdir()
    (folder / "params.yaml").write_text("m: 3.5\n")
    for name in ("small.toml", "card/card.json"):
        (folder / name).write_text(SUITE)
    (folder / "duels.toml").write_text(GROUP)
    (folder / "broken.py").write_text("import nothing_there\n\nclass Planner: pass\n")
    entries = ('controller = "gap_finder"\nstart_s = 1.0', 'controller = "pure_pursuit"')
    (folder / "starts.toml").write_text("".join(f"[[entries]]\n{entry}\n\n" for entry in entries))
    x, y, _ = fg.load_track("oval").start_pose(-0.8, -0.15)
    box = f"{{kind = 'box', x = {x}, y = {y}, length = 0.3, width = 0.3}}"
    (folder / "box.toml").write_text(f"obstacles = [{box}]")
    return folder


@each("line, said", LINES)
def test_a_line_of_a_command_is_refused_in_a_line(line, said, filled, monkeypatch, capsys):
    monkeypatch.chdir(filled)
    assert said in refused(filled, capsys, *line.split())


# -- suites

GROUP = '[[groups]]\nname = "a"\ntrack = "oval"\nopponent = "middle"\nspeed = 0.5\n'
CHECK = "[[checks]]\ncheck = 'finishes'\n"
SUITES = [
    # groups
    (SUITE.replace('name = "small"', 'nam = "small"'), "nam is no setting of a suite"),
    (SUITE.replace("boxes", "circuits"), "has the group 'circuits' twice"),
    (SUITE.replace("obstacles", "obstacle"), "group 'boxes': "),
    (SUITE.replace("obstacles", "obstacle"), "did you mean"),
    (SUITE.replace("obstacles = 2", 'assist = "full"'), "assist is of the planner"),
    (SUITE.replace('track = "oval"', ""), "group 'boxes': it has no track"),
    (SUITE.replace('"full"]', '"ful"]'), "did you mean 'full'"), (SUITE.replace("4.0", "-4.0"), "max_speed is -4.0"),
    # duels
    ("time_limit = 8.0\n", "has no groups; accepted: one or more groups"),
    (f"{GROUP}starts = 0\n", "starts is 0; accepted: a whole number from 1"),
    (f"{GROUP}starts = 1000000000000\n", "accepted: a whole number from 1 to 100000"),
    (f'{GROUP}starts = {"9" * 400}\n', "accepted: whole numbers from -922"),
    (f"{GROUP}starts = 1000\nheadway = [1, 1, 1]\noffset = {[0] * 99}\n", "make 297000"),
    (GROUP.replace('"middle"', "[1]"), "opponent 1; accepted: "), (GROUP.replace('"oval"', "[]"), "no track is given"),
    (GROUP.replace('"middle"', "[]"), "opponent is empty; accepted: right"),
    (f"passing = 3\n{GROUP}", "passing is 3 without checks"), (f"name = 5\n{GROUP}", "name is 5; accepted: a text"),
    (f'{GROUP}starts = ["a"]\n', "starts has 'a'; accepted"), (GROUP.replace("middle", "midle"), "mean 'middle'?"),
    (f"{GROUP}speeds = [0.5]\n", "speeds is no setting of a group"),
    (GROUP.replace("0.5", "[-0.5]"), "speed has -0.5; accepted: numbers above 0"),
    (f"{GROUP}headway = []\n", "headway is empty; accepted"),
    (f"time_limit = -1\n{GROUP}", "time_limit is -1; accepted"),
    (GROUP.replace('"oval"', "3"), "track is 3; accepted: one or more names or paths"),
    (GROUP.replace("oval", "scene:gap"), "scene"),
    (f'{GROUP}[[groups]]\nname = "b"\ntrack = "oval"\n', "groups of several kinds: alone, duels"),
    (f"{GROUP}heats = 2\n", "'heats' is gone; instead: `opponents`"),
    (f"{GROUP}ratio = [0.9, 0.3]\n", "ratio is (0.9, 0.3); accepted: the least and the greatest"),
    (f"{GROUP}ratio = [0.3, 0.8]\n", "ratio is (0.3, 0.8) in duels from given places; accepted: without it"),
    (GROUP.replace("middle", "blocking").replace("speed", "headway"), "headway is (0.5,) in drawn duels"),
    (f"{GROUP}seeds = [1]\n", "seeds is (1,) in a group of duels from given places"),
    (f"laps = 2\n{GROUP}", "laps is 2 in a group of duels from given places"),
    (f"{GROUP}start_s = 2.0\n", "start_s is 2.0 in a group of duels"),
    (f"assists = []\n{GROUP}", "no assist is given; accepted: one or more, each once"),
    # labs
    ("", "has no groups; accepted: one or more groups"), (f"lap = 2\n{CHECK}", "suite.toml, line 1: lap is no setting"),
    (f"controller = 'a.py:A'\n{CHECK}", "controller is of the planner"),
    (f"{CHECK}track = 'ovl'", "did you mean 'oval'?"),
    (CHECK.replace("finishes", "finish"), "checks[0]: check is 'finish'; accepted: finishes, no_crash"),
    (CHECK.replace("finishes", "lap_time"), "checks[0]: lap_time lacks most_s"),
    (CHECK.replace("finishes", "lap_time") + "most = 9", "checks[0]: lap_time has no 'most'; accepted: most_s"),
    (f"{CHECK}points = 0", "checks[0]: points is 0; accepted: a positive number"),
    (f"{CHECK}points = {'9' * 400}", "accepted: whole numbers from -922"),
    (CHECK + CHECK, "has the check 'finishes' twice"),
    (f"passing = 2\n{CHECK}", "passing is 2; accepted: a positive number up to 1"),
    (CHECK.replace("finishes", "wins"), "checks[0]: wins lacks opponents"),
    (f"{CHECK}start_offset = 5.0", "does not fit"),
    (CHECK.replace("finishes", "stops_before") + "least_speed_m_s = 1", "stops_before lacks an obstacle"),
    (f"{CHECK}opponents = ['gap_findr']", "did you mean 'gap_finder'?"),
    (CHECK.replace("finishes", "follows_wall") + "side = 'up'\ndistance_m = 1\nwithin_m = 1", "accepted: left, right"),
]  # fmt: skip


@each("text, said", SUITES)
def test_a_suite_is_refused_in_a_line(text, said, here, capsys):
    (here / "suite.toml").write_text(text)
    assert said in refused(here, capsys, "study", "suite.toml", "gap_finder", "--out", "out")


# -- calls

ZEROS = ((0, 0), (0, 0))
ERRORS = {"ranges": (1.0, 3.0), "bearings": (-1.0, 1.0), "noise": ZEROS, "bias": ZEROS, "dropout": ZEROS}
APPROACH = {"length": 0.5, "width": 0.3, "along": [0.0], "across": [0.0], "heading": [0.0], "grip": 10.0}
BASE = "gap_finder[assist=safe]"


def compare(controller=("gap_finder",), **options):
    return fg.compare(controller, out="out", **{"track": ["oval"], "seed": [0], "workers": 1} | options)


def train(**settings):
    TrainingSettings(**known_settings(settings, TrainingSettings, "a training"))


def act(action):
    env = f110.make(map="oval")
    env.reset(np.array([[0.0, 0.0, 0.0]]))
    env.step(np.array(action))


CALLS = [
    # arena
    *((ControllerChoice.of, text, "") for text in ("f[", "f[]", "f]", "[a=1]", "f[a]", "f[a=1,a=2]", "f[a=1:2]",
                                                   "f[a=1|2]", "f[a=]", "f[a=1]x", "")),
    (GeneratorSettings, {"min_length": 300.0}, "min_length is 300.0 m; accepted: at most max_length, 200.0 m"),
    (compare, {"controller": []}, "no planner is given"),
    (compare, {"controller": ["gap_finder"] * 2}, "planner gap_finder is given twice"),
    (compare, {"controller": ["nobody"]}, "'nobody' is not known"),
    (compare, {"controller": ["nothing.py"]}, "there is no file nothing.py"),
    (compare, {"track": ["nowhere"]}, "unknown track 'nowhere'"), (compare, {"seed": []}, "no seed is given"),
    (compare, {"max_speed": [4.0, 4.0]}, "max_speed 4.0 is given twice"),
    (compare, {"obstacles": 500}, "500 obstacles on track 'oval'; accepted: at most"),
    *((lambda track="oval", moving=None: ground_of(Setup.of(track, moving=moving)), given, said) for given, said in (
        ({"moving": "pedestrain"}, "'pedestrain'; accepted: box, crossing, pedestrian; did you mean 'pedestrian'"),
        ({"moving": "box:0"}, "'box:0'; accepted: box, or box:N with N from 1 to 32"),
        ({"moving": "box:x"}, "'box:x'; accepted"), ({"moving": [{"length": 1}]}, "moving[0]"),
        ({"moving": 3}, "moving is 3; accepted: a text of box, crossing, pedestrian"),
        ({"moving": "box:20"}, "on track 'oval', which has no room for it; accepted: fewer"),
        ({"track": "scene:crossing_box", "moving": "box"}, "accepted: on a track"))),
    (fg.load_track, "random:7:tigth", "asks for a random circuit of kind 'tigth'; accepted: "),
    (fg.load_track, "random:7:tigth", "; did you mean 'random:7:tight'?"),
    (fg.load_track, "random:7:oval", "kind 'oval'; accepted: random:SEED or random:SEED:tight, with SEED an integer"),
    (fg.load_track, "random:7:", "kind ''"),
    (fg.load_track, "random:x:tight", "'random:x:tight' has no seed; accepted: random:SEED or random:SEED:tight"),
    *((Approach, APPROACH | bad, "") for bad in ({"along": [math.nan]}, {"across": []}, {"heading": [0.0, 0.0]},
                                                 {"length": 0.0}, {"grip": math.inf})),
    # gym2d
    (f110.make, {"params": {"m": "heavy"}}, "params['m'] is 'heavy'; accepted: a finite number"),
    (f110.make, {"params": {"mu": 0.0}}, "params['mu'] is 0.0; accepted: above 0, up to 3"),
    (f110.make, {"num_agents": 0}, "num_agents is 0; accepted: a whole number from 1 to 8"),
    (f110.make, {"num_agents": 2, "ego_idx": 2}, "ego_idx is 2; accepted: a whole number from 0 to 1"),
    (f110.make, {"timestep": 0.0}, "timestep is 0.0 s; accepted: 1e-05 to 1 s"),
    (f110.make, {"map": "nowhere"}, "FG_MUJOCO_MAPS=FOLDER"),
    (f110.make, {"map": "nowhere"}, "unknown track 'nowhere'"),
    (f110.make, {"map": "./nowhere", "map_ext": ".png"}, "nowhere.yaml: no such file"),
    (f110.make, {"map": "oval", "map_ext": "./"}, "map_ext is './'; accepted: an ending such as '.png'"),
    (f110.make, {"map": "oval", "map_ext": 10**400}, "; accepted: a finite number from 0.01 to 100"),
    *((act, action, "accepted: finite numbers of shape (1, 2), steering angle, speed")
      for action in ([[math.nan, 1.0]], [0.0, 1.0], [[0.0, 1.0], [0.0, 1.0]], [[0.0, math.inf]])),
    (lambda poses: f110.make(map="oval").reset(poses), [[1e18, 0.0, 0.0]], "finite numbers up to 1e+06 of shape"),
    (gym_config.EnvConfig, {"max_laps": 3}, "no argument 'max_laps'"),
    (gym_config.EnvConfig, {"contact_config": 1}, "accepted: a ContactConfig"),
    (gym_config.EnvConfig, {"collision_check": gym_config.CollisionCheckMode.NONE}, "walls are solid here"),
    (gym_config.DomainRandomizationConfig, {"enabled": True}, "enabled is True; accepted: False"),
    (gym_config.EnvConfig, {"simulation": {"max_laps": 3}}, "accepted: a SimulationConfig"),
    (gym_config.SimulationConfig, {"max_lap": 3}, "did you mean 'max_laps'"),
    (gym_config.LiDARConfig, {"angle_min": -1.0}, "from -1 to 2.35619 rad; accepted: as far to both sides"),
    (gym_config.LiDARConfig, {"angle_min": -1.0, "field_of_view": 2.0}, "accepted: one of them"),
    # learn
    *((lambda record: fg.rollout("oval", n=1, record=record, time_limit=0.1), {"record": record},
       "accepted: summary, telemetry, states, scans, or scans:STEP")
      for record in ("scans:", "scans:0", "scans:-1", "scans:1.5", "scan", "states:2", "", None, 10)),
    *((lambda residual: F1TenthEnv(residual=residual), {"residual": residual}, said) for residual, said in (
        ("gap_findr", "residual has the planner 'gap_findr', which is no registered one; accepted:"),
        ("gap_finder[lern=true]", "residual: controller 'gap_finder' has no setting 'lern'"),
        ("gap_finder[learn=true]", "has no setting 'learn'; 'learn' is gone; instead: planner_mu, and"),
        ("gap_finder[assist=full+learn]", "'learn' is gone; instead: planner_mu, and"),
        ("pure_pursuit", "residual: controller 'pure_pursuit' drives by a map; accepted: where there is one"),
        ({"steering": 0.1}, "residual is {'steering': 0.1}, without planner"), (3, "residual is 3; accepted: Residual"),
        ({"planner": BASE, "steering": 0.0}, "Residual.steering is 0.0; accepted: a positive number"),
        ({"planner": BASE, "slow": -1.0}, "Residual.slow is -1.0; accepted: a number from 0"),
        ({"planner": BASE, "spede": 1.0}, "did you mean 'speed'?"))),
    *((train, {name: given}, f"a training has no setting {name!r}; {name!r} is gone; instead:")
      for name, given in (("estimate", ("mu",)), ("self_play", {"share": 0.5}))),
    # look
    *((lambda **given: LiveSession(Setup.of(**given)), given, said) for given, said in (
        ({"controller": "gap_finder[lookahead=6]", "planner_settings": {"lookahead": 6.0}}, "and in planner_settings"),
        ({"start": fg.Start(offset=1.1)}, "the car does not fit on "))),
    # realcar
    (Setup.of, {"floor": "ipz9"}, "did you mean 'ipz8'"),
    (Setup.of, {"floor": 3}, "floor is 3; accepted: a bundled name"),
    (Setup.of, {"floor": "ipz8", "mu": 0.5}, "floor is 'ipz8' and mu 0.5; accepted: one of them"),
    (Setup.of, {"floor": {"name": "ice"}}, "has no mu; accepted: name, mu"),
    (Setup.of, {"floor": {"name": "glue", "mu": 7.0}}, "accepted: a positive number up to 3"),
    (Setup.of, {"floor": {"name": "x", "mu": 0.5, "least": 0.6}}, "accepted: a range that holds mu"),
    (Setup.of, {"floor": {"name": "x", "mu": 0.5, "frictoin": 1}}, "has 'frictoin'; accepted: name"),
    *((lambda **change: MeasuredErrors.load(ERRORS | change), change, said) for change, said in (
        ({"ranges": (3.0, 1.0)}, "increasing"), ({"noise": ((0.01, 0.03),)}, "accepted: 2 rows"),
        ({"noise": ((0.01, 0.03), (0.02, -0.06))}, "noise has -0.06; accepted: 0 to 10 m"),
        ({"dropout": ((0, 0), (0, 1.5))}, "dropout has 1.5; accepted: 0 to 1"),
        ({"bias": ((0, "a"), (0, 0))}, "bias has 'a'; accepted: numbers"),
        ({"angles": (1.0,)}, "has 'angles'; accepted: ranges, bearings"))),
    # ros
    *((lambda **changes: to_scan(robot_scan(np.ones(9), **changes)), changes, said) for changes, said in (
        ({"step": 0.0}, "angle_increment is 0 rad with 9 beams"), ({"step": 3.0}, "a full turn at most"),
        ({"angle_min": math.nan}, "angle_min is nan"), ({"range_max": math.inf}, "range_max is inf"),
        ({"range_max": 0.0}, "range_max 0"), ({"range_min": -1.0}, "range_min is -1"))),
    (lambda roll: Mount.of(rotation_of(rotation(0.2, roll)), "laser"), math.radians(30.0), "is tilted by 30 deg"),
    # servers
    (split_address, "127.0.0.1:x", "accepted: HOST or HOST:PORT, such as 127.0.0.1:4567"),
]  # fmt: skip
"""A function, its arguments by name or its only one, and what is said."""


@each("call, given, said", CALLS)
def test_a_call_is_refused_in_a_line(call, given, said, here):
    with pytest.raises(FgMujocoError, match=re.escape(said)) as refusal:
        call(**given) if isinstance(given, dict) else call(given)
    assert said or "accepted: " in str(refusal.value)
    assert "\n" not in str(refusal.value) and not list(here.iterdir())


# -- what is not installed


@each(
    ("require", "extra", "what"),
    [
        (require_viser, "live", "the live view in a browser needs viser"),
        (require_ros_extra, "ros", "ROS bags need mcap, rosbags and SciPy"),
        (require_cyclonedds, "ros2", "a node of ROS 2 needs cyclonedds, mcap, rosbags and SciPy"),
        (require_scipy, "ros", "identification needs SciPy"),
        (require_ray, "cluster", "rollouts on a cluster need Ray"),
        (require_onnxruntime, "policies", "policies in ONNX files need onnxruntime"),
        (require_onnx, "train", "writing ONNX files needs onnx"),
        (require_minari, "datasets", "Minari datasets need Minari"),
    ],
)
def test_a_missing_extra_is_named_with_what_needs_it(require, extra, what, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, package=None: None)
    with pytest.raises(fg.MissingExtraError) as missing:
        require()
    assert str(missing.value) == f"{what}: {install_command(extra)}"
    assert f"\n{extra} = [" in (Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8")
