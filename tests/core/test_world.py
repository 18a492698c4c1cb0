"""A world is what its XML says; who touches whom; and what is seen is what is hit."""

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.simulation.cars import CAR_PREFIX
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.settings import Start
from fg_mujoco.vehicle.car import WHEELS

# The oval starts along x, with straight walls at y = +-1.1 m; the box is turned, the cylinder offers an edge.
BOX = fg.Box(x=3.0, y=0.2, length=0.4, width=0.6, heading=0.5)
CYLINDER = fg.Cylinder(x=-3.0, y=-0.1, radius=0.25)


def bits(model):
    """All of a model, byte for byte."""
    buffer = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def geoms(model):
    return [model.geom(index) for index in range(model.ngeom)]


def role(geom):
    """What a geom is, by its name."""
    kind = geom.name.removeprefix(CAR_PREFIX)
    if kind in ("ground", "chassis", "hull", "lidar/puck"):
        return kind.removeprefix("lidar/")
    if kind in [f"{wheel}_tire" for wheel in WHEELS]:
        return "tire"
    if kind.startswith(("wall_", "obstacle_")):
        return kind.split("_")[0]
    return "picture"


@pytest.fixture(scope="module")
def world():
    return fg.World("oval", obstacles=(BOX, CYLINDER))


@each("backend", ("raycast", "rangefinder"))
def test_the_model_is_that_of_the_xml_bit_for_bit(backend, tmp_path):
    world = fg.World("l_corridor", lidar=backend, mu=0.8, obstacles=(fg.Box(x=0.0, y=50.0, length=1.0, width=1.0),))
    assert bits(mujoco.MjModel.from_xml_string(world.xml)) == bits(world.model)
    (tmp_path / "scene.xml").write_text(world.xml)
    assert bits(mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))) == bits(world.model)
    assert bits(fg.World("l_corridor", lidar=backend).model) != bits(world.model)


def test_no_jacobian_is_sparse_on_the_mujoco_that_solves_those_wrongly(tmp_path, monkeypatch):
    text = fg.Vehicle.load("f1tenth").text
    (tmp_path / "sparse.xml").write_text(text.replace("<option ", '<option jacobian="sparse" '))
    car = fg.Vehicle.load(tmp_path / "sparse.xml")
    for version, mu, sparse in (("4.0.1", 0.8, 1), ("4.0.0", 0.9, 0)):  # another mu: worlds are kept by their cars
        monkeypatch.setattr(mujoco, "__version__", version)
        assert mujoco.mj_isSparse(fg.World("oval", car, mu=mu).model) == sparse


def test_tires_hull_and_lidar_touch_the_ground_and_only_the_chassis_touches_walls_and_obstacles(world):
    """MuJoCo's rule: contype against conaffinity either way, over all pairs of geoms; and the explicit pairs."""
    touching = set()
    for first in geoms(world.model):
        for second in geoms(world.model):
            if first.contype[0] & second.conaffinity[0]:
                touching.add(frozenset((role(first), role(second))))
    assert not any("tire" in pair for pair in touching)
    paired = zip(world.model.pair_geom1, world.model.pair_geom2, strict=True)
    touching |= {frozenset(role(world.model.geom(int(geom))) for geom in pair) for pair in paired}
    assert world.model.npair == 6
    # the last is for two cars: a body's own geoms never touch each other
    pairs = (("tire", "ground"), ("chassis", "wall"), ("chassis", "obstacle"), ("chassis", "chassis"))
    pairs += (("hull", "ground"), ("puck", "ground"))
    assert touching == {frozenset(pair) for pair in pairs}
    roles = [role(geom) for geom in geoms(world.model)]
    assert (roles.count("tire"), roles.count("chassis"), roles.count("obstacle")) == (4, 1, 2)
    assert roles.count("wall") == len(world.track.left_wall) + len(world.track.right_wall)


def forward_clearance(scan, car):
    """From the front bumper to the first thing ahead over the width of the car, as the LiDAR sees it [m]."""
    front = car.length - car.rear_overhang - car.lidar_offset
    ahead, aside = scan.ranges * np.cos(scan.bearings), scan.ranges * np.sin(scan.bearings)
    return ahead[(np.abs(aside) <= 0.5 * car.width) & (ahead > 0.0)].min() - front


@each("backend", ("raycast", "rangefinder"))
@each(
    ("x", "y", "heading"),
    (
        (1.0, 0.0, 0.5 * np.pi),  # square against the left wall
        (1.0, 0.0, -0.5 * np.pi),  # and the right one
        (1.5, 0.1, 0.0),  # a corner of the box
        (-1.5, -0.1, np.pi),  # the edge of the cylinder
    ),
)
def test_what_is_seen_is_what_is_hit(backend, x, y, heading):
    """The car is moved ahead, not driven, to where it first touches: within 2 mm of where the LiDAR says."""
    world = fg.World("oval", lidar=backend, obstacles=(BOX, CYLINDER))
    data, lidar = mujoco.MjData(world.model), world.make_lidar()
    world.car.set_pose(data, x, y, heading)
    clearance = forward_clearance(lidar.beams.to_scan(lidar.ranges(data), 0.0), world.parameters)
    assert 0.3 < clearance < 2.0

    def touches(travel):
        world.car.set_pose(data, x + travel * np.cos(heading), y + travel * np.sin(heading), heading)
        return world.car.crashed(data)

    free, touching = 0.0, clearance + 0.02
    assert not touches(free) and touches(touching)
    while touching - free > 1e-5:
        middle = 0.5 * (free + touching)
        free, touching = (free, middle) if touches(middle) else (middle, touching)
    assert touching == pytest.approx(clearance, abs=2e-3)


@each("mu", (None, 0.37, 0.8))
def test_mu_reaches_all_four_tires_of_the_ideal_law(mu):
    """Dragged sideways, each has mu times its load, and nothing touches the ground but the tires' law."""
    world = fg.World("oval", mu=mu, tires="coulomb")
    expected = 1.0489 if mu is None else mu
    assert world.car.mu == expected
    engine, data = Engine(world), mujoco.MjData(world.model)
    engine.place([Start(s=3.0)])
    engine.qvel(0)[1] = 1.0
    engine.drive()
    slip = engine.slip()
    assert slip[3][1:] == pytest.approx(expected * slip[2][1:], rel=1e-6) and (slip[2] > 1.0).all()
    engine.read(0, data)
    assert len(data.contact) == 0


def test_a_car_in_a_wall_finds_room_for_its_contacts(world):
    """Beside a wall, pushing into it: far from all the memory that the car's MJCF asks for."""
    simulation = fg.Simulation(world)
    simulation.reset(offset=1.0)  # 55 mm of its side are in the wall
    assert simulation.crashed
    for _ in range(40):
        simulation.step(fg.DriveCommand(steering_angle=0.4, speed=5.0))
    assert not simulation.unstable and simulation.data.warning.number.sum() == 0
    assert simulation.data.maxuse_arena < 0.25 * world.model.narena
