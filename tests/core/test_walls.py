"""Walls as they stand in halls: ducts, gaps, the hall behind them, and what beams make of all that."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.built_walls import Walls
from fg_mujoco.course.polyline import is_inside, step_lengths
from fg_mujoco.course.track import Track
from fg_mujoco.errors import TrackError
from fg_mujoco.racing.run_folder import write_run
from fg_mujoco.simulation.cars import WorldCar
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.simulation import Simulation
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle.tire_forces import TireForces
from map_oracles import draw_walls


@pytest.fixture(scope="module")
def straight():
    """A long circuit of two straight lines, 2 m wide."""
    line = fg.load_track("oval").centreline
    return Track(name="straight", centreline=line * (4.0, 1.0), width_right=np.ones(len(line)),
                 width_left=np.ones(len(line)))  # fmt: skip


def pitched(world, angle):
    """The data of a world whose car is pitched nose down by an angle [rad] on its start."""
    data = mujoco.MjData(world.model)
    x, y, heading = world.track.start_pose()
    turn, pitch, both = np.zeros(4), np.zeros(4), np.zeros(4)
    mujoco.mju_axisAngle2Quat(turn, np.array([0.0, 0.0, 1.0]), heading)
    mujoco.mju_axisAngle2Quat(pitch, np.array([0.0, 1.0, 0.0]), angle)
    mujoco.mju_mulQuat(both, turn, pitch)
    data.joint("car/base_link").qpos[:] = (x, y, world.model.qpos0[2], *both)
    mujoco.mj_kinematics(world.model, data)
    return data


def test_a_duct_is_a_closed_pipe_of_its_section_along_the_middle_of_its_footprints():
    course = fg.load_track("oval[walls=duct,height=0.2]")
    mesh = trimesh.Trimesh(*course.wall_surface())
    mesh.merge_vertices()
    assert mesh.is_watertight and mesh.is_winding_consistent
    feet = np.array([wall.footprint for wall in course.walls])
    along = np.linalg.norm(0.5 * (feet[:, 1] + feet[:, 2] - feet[:, 0] - feet[:, 3]), axis=1)
    assert mesh.volume == pytest.approx(3.0 * 0.1**2 * along.sum(), rel=1e-3)  # 12 triangles of r^2 sin(30 deg) / 2
    assert mesh.bounds[:, 2] == pytest.approx((0.0, 0.2))
    inner = np.concatenate((course.left_wall, course.right_wall))
    near = np.abs(mesh.vertices[:, 2] - 0.1) < 1e-9
    distances = np.linalg.norm(mesh.vertices[near, None, :2] - inner, axis=2)
    assert distances.min(axis=0).max() < 1e-9  # it is nearest to the road half way up, at the inner faces


@each("kind", ["duct", "upright"])
def test_gaps_are_as_wide_as_told_and_beams_pass_through_them(kind):
    course = replace(fg.load_track("oval"), built=Walls(kind=kind, gap=0.5, piece=3.0, seed=3))
    whole = sum(step_lengths(edge).sum() for edge in course.edges)
    feet = np.array([wall.footprint for wall in course.walls])
    stands = np.linalg.norm(feet[:, 1] - feet[:, 0], axis=1).sum()
    count = len(trimesh.Trimesh(*course.wall_surface()).split(only_watertight=False))
    assert whole - stands == pytest.approx(0.5 * count, abs=0.02 * 2 * count)  # an end may move to a corner 2 cm away
    assert 0.75 < count / (whole / 3.5) < 1.35
    world = World(course)
    assert np.isinf(world.lidar.ranges(pitched(world, 0.0))).any()
    hall = World(replace(course, built=replace(course.built, room=2.0)))
    assert np.isfinite(hall.lidar.ranges(pitched(hall, 0.0))).all()


def test_what_stands_in_the_hall_is_off_the_road_and_within_the_hall():
    course = fg.load_track("hairpins[walls=duct,room=4,clutter=40,wall_seed=5]")
    sides, clutter = course.hall[:4], course.hall[4:]
    assert len(clutter) == 40
    low, high = np.concatenate(course.edges).min(axis=0) - 4.3, np.concatenate(course.edges).max(axis=0) + 4.3
    inner = np.concatenate([side.corners() for side in sides])
    assert (inner.min(axis=0) < low + 1e-9).all() and (inner.max(axis=0) > high - 1e-9).all()
    for box in clutter:
        corners = box.corners()
        assert not is_inside(corners, course.edges).any()
        assert (corners > low).all() and (corners < high).all()


def braking(world):
    """The data of a world whose car brakes at .6 g from 6 m/s."""

    def brakes(scan, odometry):
        return fg.DriveCommand(steering_angle=0.0, speed=6.0 - 0.6 * 9.81 * odometry.stamp)

    result = fg.race(world.track, brakes, start=fg.Start(s=2.0, speed=6.0), time_limit=0.8)
    assert result.car.column("ax_m_s2")[-1] == pytest.approx(-0.6 * 9.81, rel=0.1)
    engine, data = Engine(result.world), mujoco.MjData(world.model)
    engine.load(result.states[-1])
    engine.read(0, data)
    return data


@each("angle", [0.0, 0.03, 0.08, 0.15, None])
def test_over_a_duct_beams_meet_the_floor_the_duct_or_the_hall_as_trigonometry_says(straight, angle):
    """A car between two straight ducts of 20 cm, 2 m apart, in a hall; pitched, or as it is when it brakes."""
    world = World(replace(straight, built=Walls(kind="duct", height=0.2, room=5.0)))
    data, beams = braking(world) if angle is None else pitched(world, angle), world.lidar.beams
    if angle is None:
        angle = math.asin(-data.xmat[world.lidar.body][6])
        assert 0.008 < angle < 0.012
    height = data.xpos[world.lidar.body][2]
    ranges = world.lidar.ranges(data)
    aside = (np.abs(np.sin(beams.bearings)) > 0.05) & np.isfinite(ranges)  # others look along the ducts
    down = -data.xmat[world.lidar.body][6:8] @ (np.cos(beams.bearings), np.sin(beams.bearings))  # of a beam, a metre
    off = np.sqrt(1.0 - down**2)
    lateral = data.xpos[world.lidar.body][1] - straight.centreline[0, 1]
    beside = np.where(beams.bearings > 0.0, 1.0 - lateral, 1.0 + lateral)
    to_duct = beside / np.abs(np.sin(beams.bearings))  # to its nearest line
    rise, slope = height - to_duct * down, -down / np.abs(np.sin(beams.bearings))
    past = (height + slope * (beside + 0.1) - 0.1) / np.sqrt(1.0 + slope**2)  # of the duct's middle, upwards
    floor, over = rise < 0.0, past > 0.1
    z = height - np.where(aside, ranges, 0.0) * down
    met_floor, met_hall = np.abs(z) < 1e-9, ranges * off > 2.0 * to_duct
    # not where a duct curves down to the floor, nor where its sides are within their circle
    clear = aside & ((rise < -0.03) | (rise > 0.01)) & ((past < 0.09) | (past > 0.105))
    assert clear.sum() > 0.8 * aside.sum()
    assert (met_floor == floor)[clear].all()
    assert (met_hall == over)[clear].all()
    assert (met_floor[clear].any(), met_hall[clear].any()) == (angle > 0.0, angle >= 0.15)


@each("share", [0.0, 0.2, 0.7, 1.0])
def test_a_porous_wall_lets_its_share_of_the_beams_through(share):
    plain, porous = World("oval"), World(f"oval[porosity={share},room=3]")
    data = pitched(porous, 0.0)
    through = porous.lidar.ranges(data) > plain.lidar.ranges(pitched(plain, 0.0)) + 0.2
    assert np.array_equal(porous.lidar.ranges(data), porous.make_lidar().ranges(data))  # holes stay where they are
    assert through.mean() == pytest.approx(share, abs=4.0 * math.sqrt(share * (1.0 - share) / 1081) + 1e-12)


def test_beams_that_meet_the_floor_at_a_glancing_angle_do_not_come_back(straight):
    world = World(replace(straight, built=Walls(room=5.0)))
    data, beams = pitched(world, 0.06), world.lidar.beams
    plain = world.lidar.ranges(data)
    height = data.xpos[world.lidar.body][2]
    down = math.sin(0.06) * np.cos(beams.bearings)
    floor = np.abs(height - plain * down) < 1e-9
    world.lidar.optics[:] = 0.0, math.sin(0.055)
    lost = np.isinf(world.lidar.ranges(data))
    assert lost.any() and (floor & ~lost).any()
    assert np.array_equal(lost, floor & (down < math.sin(0.055)))


def test_of_a_car_that_beams_pass_through_the_box_is_seen_that_the_rules_ask_for():
    world, alone = World("oval", others=[WorldCar(vehicle=fg.Vehicle.load("f1tenth"))]), World("oval")
    other = world.track.start_pose(2.0)

    def nearer(angle, share):  # the beams that the other car, 2 m ahead, ends
        data = pitched(world, angle)
        data.joint("car_1/base_link").qpos[:3] = (*other[:2], world.model.qpos0[2])
        data.joint("car_1/base_link").qpos[3:] = (math.cos(other[2] / 2), 0.0, 0.0, math.sin(other[2] / 2))
        mujoco.mj_kinematics(world.model, data)
        world.lidar.optics[0] = share
        ranges = world.lidar.ranges(data)
        return ranges, ranges < alone.lidar.ranges(pitched(alone, angle)) - 0.1

    for share in (0.0, 1.0):  # level, the LiDAR looks over the chassis
        ranges, box = nearer(0.0, share)
        assert box.sum() == pytest.approx(2.0 * math.atan(0.06 / ranges[box].min()) / math.radians(0.25), abs=1.5)
    solid, half, open_ = (nearer(0.025, share)[1].sum() for share in (0.0, 0.5, 1.0))  # below the box
    assert solid > half > open_ == 0


def test_a_race_sees_through_cars_as_it_is_told():
    settings = {"opponents": ["gap_finder"], "laps": 1, "start_s": 0.0, "time_limit": 3.0}
    hashes = {share: fg.race("oval", through_cars=share, **settings).trajectory_sha256 for share in (0.0, 0.5, 0.9)}
    assert len(set(hashes.values())) == 3
    assert fg.race("oval", through_cars=0.5, **settings).trajectory_sha256 == hashes[0.5]


@each("blur", [0.0, 0.5, 0.7, 1.2])
def test_walls_of_a_map_are_built_as_the_table_says_of_the_grey_that_they_are_drawn_in(blur, tmp_path):
    course = fg.load_track(f"{draw_walls(tmp_path, blur)}[height=0.4,room=2]")
    kinds = {part.built.height: part.feet for part in course.wall_parts}
    near = 0.1  # [m] two pixels; a level that is not in the table begins five pixels from one that is
    for height, low, high in ((0.2, -9.0, -1.5), (1.0, -1.5, 2.75), (0.4, 2.5, 9.0)):
        feet = kinds[height][:, :2]
        assert feet[..., 0].min() > low - near and feet[..., 0].max() < high + near
    whole = sum(step_lengths(edge).sum() for edge in course.edges)
    stands = [np.linalg.norm(feet[:, 1] - feet[:, 0], axis=1).sum() for feet in kinds.values()]
    assert sum(stands) == pytest.approx(whole, rel=1e-9) and len(kinds) == 3
    assert len(course.hall) == 4 and len(course.walls) == sum(map(len, kinds.values()))
    assert all(World(course).model.geom(seen).name == seen for seen in ("ducts_1", "walls_2", "walls"))


@each("table", [
    "[0]", "{0: duct}", "{0: {hight: 0.2}}", "{0: {walls: round}}", "{30: {height: 0.2}}", "{254: {height: 0.2}}",
    "{black: {height: 0.2}}", "{-1: {height: 0.2}}", "{0: {height: 20}}", "{0: {room: 5}}",
])  # fmt: skip
def test_tables_of_walls_that_cannot_be_are_refused_in_a_line_with_the_file(table, tmp_path):
    with pytest.raises(TrackError, match=r"drawn\.yaml.*accepted") as refused:
        fg.load_track(draw_walls(tmp_path, 0.0, table))
    assert "\n" not in str(refused.value)


PUSHED = "oval[walls=duct,height=0.2,weight=2,room=3]"


@each("motion", [(1.5, 0.0, 0.0), (-0.6, 0.8, 0.0), (0.0, 0.0, 2.0), (0.5, 0.0, 1.0)])
def test_a_piece_that_slides_comes_to_rest_where_coulombs_law_says(motion):
    world = World(PUSHED)
    simulation, model = Simulation(world), world.model
    simulation.reset()
    data, pieces = simulation.data, [model.body(f"piece_{number}") for number in range(20)]
    body = max(pieces, key=lambda piece: piece.inertia[2] / piece.mass[0] / (piece.mass[0] ** 2 / 4.0 + 0.04))
    first, dof, mass, inertia = model.jnt_qposadr[body.jntadr[0]], body.dofadr[0], body.mass[0], body.inertia[2]
    length = mass / 2.0
    assert inertia == pytest.approx(mass * (length**2 + 0.2**2) / 12.0, rel=2e-3)  # it is a straight one
    before = data.qpos[first : first + 3].copy()
    data.qvel[dof : dof + 3] = motion
    for _ in range(60):
        simulation.step(fg.DriveCommand(steering_angle=0.0, speed=0.0))
    moved = data.qpos[first : first + 3] - before
    assert not data.qvel[dof : dof + 3].any()
    alone = np.array(motion[:2]) * math.hypot(*motion[:2]) / (2 * 0.5 * 9.81)  # v^2 / 2 mu g, along its motion
    if motion[2] == 0.0:
        assert moved[:2] == pytest.approx(alone, rel=0.02)
    elif not any(motion[:2]):  # the moment of its friction is mu m g L / 4
        slowing = 0.5 * mass * 9.81 * 0.25 * length / inertia
        assert moved[2] == pytest.approx(motion[2] ** 2 / (2 * slowing), rel=0.02)
    else:  # it goes on for longer when it turns
        assert moved[0] > 1.1 * alone[0]


def test_a_car_that_hits_a_piece_gives_it_the_momentum_that_it_loses():
    world = World("oval[weight=2,room=3]")
    model, data, forces = world.model, mujoco.MjData(world.model), TireForces(world.model, "car/")
    x, y, heading = world.track.start_pose()
    world.car.set_pose(data, x, y, heading + 0.5 * math.pi, 3.0)
    world.car.apply(data, fg.DriveCommand(steering_angle=0.0, speed=3.0))
    forces.begin(data)
    car = model.body("car/base_link").id
    pieces = [(body.dofadr[0], body.mass[0]) for body in map(model.body, (f"piece_{number}" for number in range(20)))]

    def momentum():
        for update in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel, mujoco.mj_subtreeVel):
            update(model, data)
        return model.body_subtreemass[car] * data.subtree_linvel[car, :2]

    gained = np.zeros(2)
    while not gained.any():
        before = momentum()
        forces.step(data)
        gained = sum(mass * data.qvel[dof : dof + 2] for dof, mass in pieces)
    lost = before - momentum()
    assert np.linalg.norm(gained) > 2.0
    assert gained == pytest.approx(lost, abs=0.08 * np.linalg.norm(gained))  # but for what the tires push meanwhile


def test_beams_see_a_piece_where_it_is_as_mujocos_own_rays_do():
    drawn, cast = World(PUSHED), World(PUSHED, lidar="rangefinder")
    found = []
    for world in (drawn, cast):
        data = pitched(world, 0.0)
        for piece in range(4):
            data.qpos[world.model.jnt_qposadr[world.model.body(f"piece_{piece}").jntadr[0]] :][:3] = 0.3, 0.2, 0.1
        mujoco.mj_forward(world.model, data)
        found.append(world.lidar.ranges(data))
    assert found[0] == pytest.approx(found[1], abs=2e-4)  # as on any course: sites keep six digits in MJCF
    assert np.abs(found[0] - drawn.lidar.ranges(pitched(drawn, 0.0))).max() > 0.05


def test_a_race_into_a_duct_that_moves_is_a_collision_and_is_replayed(tmp_path):
    ahead = fg.DriveCommand(steering_angle=0.0, speed=3.0)
    for name in (PUSHED.replace(",weight=2", ""), PUSHED):
        race = fg.race(name, lambda scan, odometry: ahead, laps=1, time_limit=4.0)
        assert race.car.collisions_wall > 0
    assert fg.replay(write_run(race, tmp_path / "run")).identical


def test_walls_below_the_lidar_with_nothing_behind_are_remarked():
    with pytest.warns(UserWarning, match=r"0\.1 m.*below the LiDAR"):
        World("oval[height=0.1]")
