"""The points of a MID-360 against mj_ray, closed forms, and each other however they are cast."""

import copy

import gymnasium
import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.envs.gym_environment import F1TenthEnv
from fg_mujoco.envs.gym_vector import F1TenthVectorEnv
from fg_mujoco.errors import SettingsError
from fg_mujoco.lidar import point_cloud as cloud
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.cars import WorldCar
from fg_mujoco.vehicle.sensors.livox import Mid360
from scene_search import corridor_walls

LOW, HIGH = np.radians(cloud.Sheet.load().elevations)
STILL = np.ones(cloud.BURSTS), np.zeros(cloud.BURSTS)  # shares and times of a frame at one moment


def directions(count, first=0):
    """Return the directions of points by the pattern's closed form (n, 3): turns of 20 ms, and a triangle wave."""
    index = first * cloud.LINES * cloud.COLUMNS + np.arange(count)
    step, line = index // cloud.LINES, index % cloud.LINES
    azimuth = (step % 1000 + line / cloud.LINES) * np.radians(0.36)
    phase = (step + line * cloud.CYCLE // cloud.LINES) % cloud.CYCLE / cloud.CYCLE + 0.25 / cloud.CYCLE
    elevation = LOW + (HIGH - LOW) * np.minimum(2.0 * phase, 2.0 - 2.0 * phase)
    level = np.cos(elevation)
    return np.column_stack((np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)))


def placed(world, rng):
    """Return data of a world with car 0 tilted on the course, and the others around it."""
    data = mujoco.MjData(world.model)
    for index in range(len(world.cars)):
        base = world.model.body("car/base_link" if index == 0 else f"car_{index}/base_link")
        at = world.model.jnt_qposadr[base.jntadr[0]]
        along = 2.0 + 1.2 * index
        x, y, heading = world.track.start_pose(along)
        height = data.qpos[at + 2] + (0.5 if getattr(world.track, "ground", None) is not None else rng.uniform(0, 0.1))
        data.qpos[at : at + 3] = x, y + 0.3 * (index > 0), height
        mujoco.mju_euler2Quat(data.qpos[at + 3 : at + 7], np.array((heading, *rng.normal(0.0, 0.05, 2))), "zyx")
    mujoco.mj_kinematics(world.model, data)
    return data


def rays(world, data, sent):
    """Return the distances by mj_ray along directions (n, 3) of the MID-360, past the own car [m]; -1: nothing."""
    model, caster = copy.copy(world.model), cloud.PointCaster(world.model, "car/lidar/")
    own = model.body_rootid[model.geom_bodyid] == model.body("car/base_link").rootid
    model.geom_matid[own], model.geom_rgba[own, 3] = -1, 0.0
    turn, at = np.zeros(9), data.qpos[caster.mount.qpos_address :][:7]
    mujoco.mju_quat2Mat(turn, at[3:])
    eye, turn = at[:3] + turn.reshape(3, 3) @ caster.mount.offset_position, turn.reshape(3, 3)
    met = np.zeros(1, np.int32)
    turn = turn @ caster.mount.offset_rotation
    return np.array([mujoco.mj_ray(model, data, eye, turn @ way, None, 1, -1, met) for way in sent])


@each("name", ["oval", "oval[walls=duct,height=0.2,room=5,clutter=20]", "hairpins[bank=10,roughness=C,walls=duct]"])
def test_points_are_those_of_mujocos_rays(name):
    rng = np.random.default_rng(3)
    world = fg.World(name, others=() if "bank" in name else (WorldCar(), WorldCar()))
    for first in (0, 1234567):
        data = placed(world, rng)
        points = cloud.PointCaster(world.model, "car/lidar/").cast(data.qpos, data.qpos, *STILL, first).reshape(-1, 4)
        chosen = rng.permutation(cloud.POINTS)[:2500]
        sent = directions(cloud.POINTS, first)[chosen]
        found, places = rays(world, data, sent), points[chosen, :3]
        away = np.linalg.norm(places, axis=1)
        seen = (found >= 0.1) & (found < 45.0)  # where the darkest surface here, of a duct, is seen, too
        assert away[seen].all() and not away[(found < 0.1) | (found > 70.0)].any()
        assert np.abs(places - sent * found[:, None])[away > 0.0].max() < 1e-9 and (away > 0.0).sum() > 150
        assert ((points[:, 3] > 0.0) == (points[:, :3] != 0.0).any(axis=1)).all()


def test_coverage_grows_and_no_direction_comes_again():
    sent = directions(400_000)
    assert np.degrees(np.arcsin(sent[:, 2].min())) == pytest.approx(-7.21, abs=0.01)
    assert np.degrees(np.arcsin(sent[:, 2].max())) == pytest.approx(52.16, abs=0.01)
    cells = np.floor(np.degrees(np.column_stack((np.arctan2(sent[:, 1], sent[:, 0]), np.arcsin(sent[:, 2]) - LOW))))
    shares = [len(np.unique(cells[:count], axis=0)) / (360 * 59.37) for count in (20_000, 40_000, 100_000, 200_000)]
    assert [round(share, 2) for share in shares] == sorted(round(share, 2) for share in shares)
    assert shares[0] > 0.3 and shares[1] > 0.55 and shares[2] > 0.95 and shares[3] > 0.99
    assert len(np.unique(np.round(sent, 12), axis=0)) == len(sent)


def test_dark_surfaces_are_seen_less_far():
    spec = mujoco.MjSpec()
    for colour in (0.1, 0.8):
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(1, 1, 1), rgba=(*[colour] * 3, 1.0))
    assert cloud.materials_of(spec.compile())[1].tolist() == [[15.0, pytest.approx(40.0)], [120.0, pytest.approx(70.0)]]


def test_a_share_of_points_passes_porous_walls():
    solid, porous = (fg.World(f"oval[walls=duct,height=0.33,room=4{more}]") for more in ("", ",porosity=0.4"))
    data = placed(solid, np.random.default_rng(1))
    casters = [cloud.PointCaster(world.model, "car/lidar/") for world in (solid, porous)]
    seen = [caster.cast(data.qpos, data.qpos, *STILL, 0) for caster in casters]
    (near, far), duct = (np.linalg.norm(each[..., :3], axis=2) for each in seen), seen[0][..., 3] < 40.0
    ducts = duct & (near > 0.0)
    passed = (far[ducts] > near[ducts] + 1e-6) | (far[ducts] == 0.0)
    assert passed.mean() == pytest.approx(np.sqrt(0.4), abs=0.03)  # of the front; the back takes its share, too
    assert np.array_equal(near[~duct], far[~duct])


def drive(ticks=12, name="oval", settings=None, **race):
    """Return the readings of a MID-360 on a car that speeds up, and qpos of each tick from the start on."""
    simulation = fg.Simulation(fg.World(name, **race), sensors=[settings or "mid360"], seed=5)
    _, odometry = simulation.reset(speed=3.0)
    states, readings = [simulation.engine.qpos(0).copy()], []
    for _ in range(ticks):
        _, odometry = simulation.step(fg.DriveCommand(steering_angle=0.2, speed=6.0))
        states.append(simulation.engine.qpos(0).copy())
        readings += list(odometry.readings["mid360"].samples)
    return simulation, states, [reading.reshape(cloud.BURSTS, -1, 4) for reading in readings]


def test_a_frame_is_skewed_as_the_car_moves():
    simulation, states, frames = drive(8)
    caster, share = cloud.PointCaster(simulation.world.model, "car/lidar/"), np.ones(1)
    assert len(frames) == 2
    for burst in (40, 47, 79):
        tick, place = divmod(burst + 0.5, 10)
        state = states[int(tick)] + place / 10 * (states[int(tick) + 1] - states[int(tick)])
        alone = caster.cast(state, state, share, np.zeros(1), burst)[0]
        assert np.abs(frames[1][burst - 40] - alone).max() < 1e-9
    moved = caster.cast(states[8], states[8], *STILL, 40)
    assert np.abs(frames[1] - moved).max() > 0.1


def test_times_and_lines_follow_from_the_index():
    points = cloud.point_cloud(np.arange(4.0 * cloud.POINTS), 5e8)
    assert points.dtype.itemsize == 26 and points.dtype.fields["timestamp"][1] == 18
    assert points["line"][:6].tolist() == [0, 1, 2, 3, 0, 1] and points["y"][2] == 9.0 and points["intensity"][1] == 7.0
    assert points["timestamp"][[0, 499, 500, -1]].tolist() == pytest.approx([4.0125e8, 4.0125e8, 4.0375e8, 4.9875e8])


def test_noise_is_that_of_its_settings_and_seed():
    plain = drive(4)[2][0].reshape(-1, 4)
    settings = {"sensor": "mid360", "range_noise_std": 0.02, "angle_noise_std": 0.003}
    noisy, again = (drive(4, settings=settings)[2][0].reshape(-1, 4) for _ in range(2))
    hit = plain[:, 3] > 0.0
    assert np.array_equal(noisy, again) and not noisy[~hit].any()
    away = np.linalg.norm(plain[hit, :3], axis=1)
    along = plain[hit, :3] / away[:, None]
    error = noisy[hit, :3] - plain[hit, :3]
    spread = (error * along).sum(axis=1)
    across = np.linalg.norm(error - spread[:, None] * along, axis=1) / away
    assert spread.std() == pytest.approx(0.02, rel=0.05) and abs(spread.mean()) < 2e-3
    assert np.sqrt((across**2).mean()) == pytest.approx(0.003 * np.sqrt(2.0), rel=0.05)


def test_moving_obstacles_are_where_they_are_at_a_burst():
    moving = fg.MovingObstacle(length=0.4, width=2.0, start=(2.0, 0.0), end=(18.0, 0.0), speed=4.0)
    way, walls = np.array([[-3.0, 0.0], [20.0, 0.0]]), corridor_walls(-4.0, 20.0, 4.0)
    scene = fg.Scene(name="test", way=way, start=3.0, goal=15.0, moving=(moving,), time_limit=40.0, walls=walls)
    world = fg.World(scene)
    data = mujoco.MjData(world.model)
    caster, times = cloud.PointCaster(world.model, "car/lidar/"), np.array((0.0, 1.0, 2.0))
    eye = data.qpos[caster.mount.qpos_address] + caster.mount.offset_position[0]
    met = 0
    for first in range(0, 400, 8):  # those that look ahead
        points = caster.cast(data.qpos, data.qpos, np.ones(3), times, first)[:, :100]
        for time, own in zip(times, points, strict=True):
            ahead = own[(np.abs(own[:, 1]) < 0.8) & (own[:, 0] > 0.0) & (np.abs(own[:, 2]) < 0.1)]
            assert np.allclose(ahead[:, 0], 2.0 + 4.0 * time - 0.2 - eye, atol=1e-9)
            met += len(ahead)
    assert met > 50


def test_environments_observe_the_same_bits_in_any_batch():
    one = F1TenthEnv(track="oval", sensors=["mid360"])
    many = F1TenthVectorEnv(3, track="oval", sensors=["mid360"], threads=2)
    assert one.observation_space["mid360"] == gymnasium.spaces.Box(-np.inf, np.inf, (4 * cloud.POINTS,), np.float32)
    one.reset(seed=4)
    many.reset(seed=[3, 4, 5])
    for tick in range(6):
        (seen, *_), (all_seen, *_) = one.step(one.action_space.high), many.step(np.tile(one.action_space.high, (3, 1)))
        assert seen["mid360_received"] == (tick >= 3)
    assert seen["mid360"].any() and np.array_equal(seen["mid360"], all_seen["mid360"][1])


def test_a_race_has_it_on_car_0():
    assert Setup.of("oval", lidar="mid360") == Setup.of("oval", sensors=["mid360"])
    setup = Setup.of("oval", lidar="mid360", opponents=["gap_finder"], sensors=["imu"])
    assert setup.lidar == "raycast"
    assert [[sensor.kind for sensor in entry.sensed] for entry in setup.entries] == [["imu", "mid360"], ["imu"]]


def test_refuses_a_tick_that_ends_within_a_frame():
    with pytest.raises(SettingsError, match="over a whole number"):
        Mid360().steps(0.005, 6)
