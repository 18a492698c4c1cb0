"""What pictures are made of, without drawing: states between ticks, tire forces, planner stages, cameras, the look."""

import math
from copy import copy
from pathlib import Path

import car_meshes
import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.track_mesh import wall_prisms
from fg_mujoco.pictures.rendering.cameras import CAMERAS, Moment, View
from fg_mujoco.pictures.rendering.force_arrows import TireForceMeter
from fg_mujoco.pictures.rendering.planner_view import PlannerEye
from fg_mujoco.pictures.rendering.recorded_drive import read_drive
from fg_mujoco.pictures.rendering.ribbons import road, wall_chains
from fg_mujoco.pictures.rendering.scenery import compile_scenery
from fg_mujoco.simulation.cars import CAR_PREFIX
from fg_mujoco.simulation.physics import STATE
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.tire_forces import TireForces


@pytest.fixture(scope="module")
def scenery(lap):
    return compile_scenery(lap.world.xml, start=(0.0, 0.0))


def test_model_for_pictures_takes_the_states_of_the_race_and_moves_the_same(lap, scenery):
    """Stepping either model from a recorded state leads to the next one, bit for bit."""
    for model in (copy(lap.world.model), copy(scenery)):
        assert mujoco.mj_stateSize(model, STATE) == lap.states.shape[1]
        data, tires = mujoco.MjData(model), TireForces(model, CAR_PREFIX)
        mujoco.mj_setState(model, data, lap.states[200], STATE)
        data.ctrl[:] = lap.ctrl[200]
        for _ in range(5):
            tires.step(data)
        reached = np.empty(lap.states.shape[1])
        mujoco.mj_getState(model, data, reached, STATE)
        np.testing.assert_array_equal(reached, lap.states[201])


def test_world_that_is_raced_has_nothing_that_is_only_to_be_seen(lap):
    assert "look/" not in lap.world.xml and ".obj" not in lap.world.xml
    assert all(not lap.world.model.geom(geom).name.startswith("look/") for geom in range(lap.world.model.ngeom))


def test_car_stays_below_the_beams_but_for_the_lidar_and_within_its_length(scenery):
    data = mujoco.MjData(scenery)
    mujoco.mj_kinematics(scenery, data)
    parts = {}
    for geom in np.flatnonzero(scenery.geom_group == 2):
        name, mesh = scenery.geom(geom).name, scenery.geom_dataid[geom]
        first, count = scenery.mesh_vertadr[mesh], scenery.mesh_vertnum[mesh]
        turned = scenery.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T
        parts[name.removeprefix("look/")] = turned + data.geom_xpos[geom]
    lidar = np.vstack([parts.pop(name) for name in ("lidar_base", "lidar_window")])
    car = np.vstack(list(parts.values()))
    low, high = car.min(axis=0), car.max(axis=0)
    assert high[2] < 0.11 < lidar[:, 2].max()
    assert low[2] > -0.0012  # tires give by .8 mm under a car at rest
    chassis = scenery.geom("car/chassis")
    for axis in (0, 1):
        assert low[axis] >= chassis.pos[axis] - chassis.size[axis] - 0.001
        assert high[axis] <= chassis.pos[axis] + chassis.size[axis] + 0.001
    assert len(parts) > 20


def test_meshes_in_the_repository_are_those_that_the_tool_makes(tmp_path):
    folder = Path(car_meshes.__file__).parents[1] / "models" / "assets"
    car_meshes.write_all(tmp_path)
    assert {path.name for path in folder.glob("*.obj")} == {path.name for path in tmp_path.glob("*.obj")}
    for path in sorted(tmp_path.glob("*.obj")):
        made, kept = (_corners(file.read_text()) for file in (path, folder / path.name))
        assert made.shape == kept.shape, path.name  # of triangles, in any order
        np.testing.assert_allclose(made, kept, atol=2e-5)
    assert sum(path.read_text().count("\nf ") for path in tmp_path.glob("*.obj")) < 8000


def _corners(text):
    """Middles of all triangles of an OBJ text, sorted."""
    vertices = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("v ")], dtype=float)
    faces = [[int(c.partition("/")[0]) - 1 for c in line.split()[1:]] for line in text.splitlines() if line[0] == "f"]
    middles = np.round(vertices[np.array(faces)].mean(axis=1), 4)
    return middles[np.lexsort(middles.T)]


WITHOUT_ROAD = ("boxes", "elbow", "maze")  # whose walls are no ribbon: the floor is drawn without a road


@each("name", fg.track_names())
def test_road_covers_the_track_and_nothing_else(name):
    """The area between the outlines, by the shoelace formula, and no triangle upside down."""
    chains = wall_chains(wall_prisms(fg.load_track(name).edges))
    assert len(chains) == 2
    left, right = (chain[:, 0, :2] for chain in chains)
    surface = road(left, right)
    if name in WITHOUT_ROAD:
        assert surface is None
        return
    a, b, c = (surface.vertices[surface.faces[:, k], :2] for k in range(3))
    areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert (areas > -1e-9).all()
    expected = abs(_area(left) - _area(right))
    assert areas.sum() == pytest.approx(expected, rel=2e-3)


def _area(line):
    x, y = line.T
    return 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


def test_forces_of_a_car_at_rest_can_carry_the_peak_of_its_axles(lap, scenery):
    data = mujoco.MjData(scenery)
    mujoco.mj_setState(scenery, data, lap.states[0], STATE)
    TireForces(copy(scenery), CAR_PREFIX).forward(data)
    forces = TireForceMeter(scenery).read(data)
    car = lap.world.parameters
    peak = (car.front_peak * car.rear_axle_distance + car.rear_peak * car.front_axle_distance) / car.wheelbase
    assert forces.limit.sum() == pytest.approx(peak * car.mass * car.gravity, rel=0.03)


def test_forces_on_the_tires_are_what_moves_the_car(lap, scenery):
    """Newton: their sum is mass times the acceleration of the CoG, here by the accelerometer's states."""
    scenery = copy(scenery)
    data, tires = mujoco.MjData(scenery), TireForces(scenery, CAR_PREFIX)
    meter = TireForceMeter(scenery)
    for tick in (60, 110, 200, 300):
        mujoco.mj_setState(scenery, data, lap.states[tick], STATE)
        data.ctrl[:] = lap.ctrl[tick]
        tires.forward(data)
        forces = meter.read(data)
        mujoco.mj_subtreeVel(scenery, data)
        base = scenery.body("car/base_link").id
        before = data.subtree_linvel[base].copy()
        tires.step(data)
        tires.forward(data)
        mujoco.mj_subtreeVel(scenery, data)
        acceleration = (data.subtree_linvel[base] - before) / scenery.opt.timestep
        total = np.nansum(forces.friction, axis=0)[:2]
        np.testing.assert_allclose(total, lap.world.parameters.mass * acceleration[:2], atol=1.5)
        recorded = [lap.car.column(f"friction_utilisation_{wheel}")[tick] for wheel in WHEELS]
        assert (forces.use <= np.array(recorded) + 1e-6).all()  # greatest of the tick, of which this is the first step


PLANNERS_WITH_GAPS = (
    "gap_finder", "overtaker", "follow_the_gap", "disparity_selection", "threshold_gap", "weighted_gap"
)  # fmt: skip


@each("name", fg.controller_names())
def test_intermediate_scans_only_shorten_beams_and_the_gap_is_where_the_planner_goes(lap, name):
    world = lap.world
    planner = fg.make_controller(name, car=world.parameters, mu=1.0489, max_speed=8.0, map_line=world.track.map_line)
    eye = PlannerEye(read_drive(lap))
    for tick in (40, 150, 260):
        scan = eye.at_tick(tick).scan
        made = planner.intermediate_scans(scan)
        assert next(iter(made)) == "raw" and all(len(ranges) == len(scan.ranges) for ranges in made.values())
        for stage in ("extended", "bubble"):  # not the gap: its edges may be a mean's
            assert (made.get(stage, made["raw"]) <= made["raw"]).all()
        if name in PLANNERS_WITH_GAPS:
            gap = np.flatnonzero(np.isfinite(made["gap"]))
            assert len(gap) and (np.diff(gap) == 1).all()
            bearing, _ = planner.find_goal(scan)
            if name != "weighted_gap":  # which goes between the gap and straight on
                first, last = scan.bearings[gap[[0, -1]]]
                assert first - 0.01 <= bearing <= last + 0.01
        else:
            assert "gap" not in made


def test_view_projects_as_a_pinhole_does():
    view = View(
        position=np.array([0.0, 0.0, 1.0]), forward=np.array([1.0, 0.0, 0.0]), up=np.array([0.0, 0.0, 1.0]),
        fovy=math.radians(90.0), focus=np.zeros(3),
    )  # fmt: skip
    places, depth = view.project([(2.0, 0.0, 1.0), (2.0, -2.0, 1.0), (2.0, 0.0, 3.0), (-1.0, 0.0, 1.0)], (200, 100))
    np.testing.assert_allclose(places[:3], [(100.0, 50.0), (150.0, 50.0), (100.0, 0.0)], atol=1e-9)
    np.testing.assert_allclose(depth, [2.0, 2.0, 2.0, -1.0])


@each("aspect", [0.5, 1.0, 16 / 9, 3.0])
def test_track_camera_shows_the_whole_course(lap, aspect):
    bounds = lap.world.track.bounds
    moment = Moment(
        time=0.0, position=np.zeros(3), rotation=np.eye(3), times=np.empty(0), headings=np.empty(0), bounds=bounds
    )
    size = (round(300 * aspect), 300)
    corners = [(x, y, 0.3) for x in bounds[:, 0] for y in bounds[:, 1]]
    places, _ = CAMERAS["track"](moment, aspect).project(corners, size)
    assert (places > 0).all() and (places < size).all()
    assert np.ptp(places, axis=0).max() > 0.8 * min(size)  # and fills it
