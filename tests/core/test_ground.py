"""Ground that is not level: the surface, and a car on it against statics and closed forms."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from PIL import Image

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.centreline_csv import write_centreline
from fg_mujoco.course.definitions import course_of
from fg_mujoco.course.ground import ROUGHNESS, SCALE, Ground, Relief
from fg_mujoco.course.polyline import distance_to_segment, segments
from fg_mujoco.course.track_mesh import WALL_HEIGHT
from fg_mujoco.errors import SettingsError, TrackError
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.ground_circles import GroundCircle, closed_form
from fg_mujoco.lab.lab_ground import LabGround
from fg_mujoco.native import core
from fg_mujoco.racing.run_folder import write_run
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.tire_rows import FORCE_ACROSS, FORCE_ALONG, LOAD, USERDATA
from map_oracles import draw_map, draw_walls, real_map, ring

GRAVITY = 9.81


class OnHeights(LabGround):
    """A car on ground whose height is a function of x and y [m]."""

    def __init__(self, height, *, reach=12.0):
        nodes = 0.1 * np.arange(-round(reach / 0.1), round(reach / 0.1) + 1)
        x, y = np.meshgrid(nodes, nodes)
        super().__init__(surface=Ground(heights=height(x, y), corner=(nodes[0], nodes[0]), cell=0.1))

    def place(self, x=0.0, y=0.0, heading=0.0, speed=0.0):
        super().place()
        self.car.set_pose(self.data, x, y, heading, speed)
        self.forces.begin(self.data)

    def hold(self, seconds, steering=0.0, speed=0.0):
        super().hold(fg.DriveCommand(steering_angle=steering, speed=speed), seconds)

    @property
    def tires(self):
        return self.data.userdata[: 4 * USERDATA].reshape(4, USERDATA)


def keys(place, heights):
    """The cubic of Keys (1981) through heights (n,) at a place in cells, ends repeated: another way to write it."""
    first = min(int(place), len(heights) - 2)
    padded, t = np.pad(heights, 2, mode="edge"), place - first
    a, b, c, d = padded[first + 1 : first + 5]
    return b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)))


def test_the_surface_is_the_cubic_of_both_axes_and_its_normal_is_its_slope():
    rng = np.random.default_rng(3)
    spec = mujoco.MjSpec()
    heights = rng.uniform(0.0, 1.0, (7, 9))
    heights = (heights - heights.min()) / np.ptp(heights)
    spec.add_hfield(name="field", nrow=7, ncol=9, size=(2.0, 1.5, 0.3, 0.1), userdata=heights.ravel())
    spec.worldbody.add_geom(name="terrain", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="field", pos=(5.0, -2.0, 0.4))
    model = spec.compile()
    stored = 0.4 + 0.3 * model.hfield_data.reshape(7, 9).astype(float)
    for x, y in rng.uniform((3.0, -3.5), (7.0, -0.5), (200, 2)):
        across, up = (x - 3.0) / 0.5, (y + 3.5) / 0.5
        height, *normal = core.surface_at(model._address, x, y)
        assert height == pytest.approx(keys(up, np.array([keys(across, row) for row in stored])), abs=1e-9)
        step = 1e-6
        rise = [
            core.surface_at(model._address, x + dx, y + dy)[0] - core.surface_at(model._address, x - dx, y - dy)[0]
            for dx, dy in ((step, 0.0), (0.0, step))
        ]
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        assert -np.array(normal[:2]) / normal[2] == pytest.approx(np.array(rise) / (2 * step), abs=1e-5)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for row, column in ((0, 0), (3, 5), (6, 8)):  # at nodes it is where MuJoCo's rays meet the field
        x, y = 3.0 + 0.5 * column, -3.5 + 0.5 * row
        inside = np.array([min(max(x, 3.001), 6.999), min(max(y, -3.499), -0.501), 5.0])
        distance = mujoco.mj_rayHfield(model, data, 0, inside, np.array([0.0, 0.0, -1.0]))
        distance = distance[0] if isinstance(distance, tuple) else distance
        assert 5.0 - distance == pytest.approx(core.surface_at(model._address, x, y)[0], abs=5e-3)
    spec.geoms[0].name = "car/own"  # a vehicle's own is no ground
    assert core.surface_at((other := spec.compile())._address, 5.0, -2.0) == (0.0, 0.0, 0.0, 1.0) and other.nhfield


@each("degrees", [-10.0, 5.0, 15.0])
def test_a_car_at_rest_on_a_bank_has_the_wheel_loads_of_statics(degrees):
    """The loads carry its weight across the slope, and with the friction they turn nothing about its centre of mass."""
    slope, angle = math.tan(math.radians(degrees)), math.radians(degrees)
    ground = OnHeights(lambda x, y: slope * y)
    spins = [ground.model.joint(f"car/{wheel}_wheel").dofadr[0] for wheel in WHEELS]
    ground.model.dof_damping[spins] = 1e6  # or it rolls down
    for heading in (0.0, 0.5 * math.pi):
        ground.place(heading=heading)
        ground.hold(4.0)
        own, loads = ground.car.parameters, ground.tires[:, LOAD]
        weight, normal = own.mass * GRAVITY, np.array([0.0, -math.sin(angle), math.cos(angle)])
        assert loads.sum() == pytest.approx(weight * math.cos(angle), rel=1e-3)
        bodies = [ground.data.body(f"car/{wheel}_wheel") for wheel in WHEELS]
        feet = []
        for body, row in zip(bodies, ground.forces.rows, strict=True):  # of an ellipsoid about its axle
            axle = body.xmat.reshape(3, 3) @ row["axle"]
            broad, lean = row["half_width"] ** 2 - row["radius"] ** 2, axle @ normal
            nearest = row["radius"] ** 2 * normal + broad * lean * axle
            feet.append(body.xpos - nearest / math.sqrt(row["radius"] ** 2 + broad * lean**2))
        mass_center = ground.data.subtree_com[ground.model.body("car/base_link").id]
        friction = np.array([0.0, 0.0, weight]) - loads.sum() * normal
        moments = np.cross(feet - mass_center, loads[:, None] * normal + 0.25 * friction)
        level = moments.sum(axis=0) - (moments.sum(axis=0) @ normal) * normal
        assert np.abs(level).max() < 1e-3 * weight * 0.5 * own.track_width


class FeltCircle(GroundCircle):
    """A circle of which the sums over the tires are kept: across, along, and the load [N]."""

    def _read(self, whole, k):
        states = whole.last(self._window(k * self.law)).states
        sums = states[:, : 4 * USERDATA].reshape(-1, 4, USERDATA).sum(axis=1).mean(axis=0)
        self.sums = sums[[FORCE_ACROSS, FORCE_ALONG, LOAD]]
        return super()._read(whole, k)


@each("degrees", [-10.0, -5.0, 0.0, 5.0, 10.0, 20.0])
def test_a_steady_circle_on_a_bank_takes_the_friction_of_the_closed_form(degrees):
    """On a cone about the origin: across the car F / N = (v^2 / g r - tan b) / (1 + v^2 / g r tan b)."""
    slope = math.tan(math.radians(degrees))
    for mu in (0.5, 0.8, 1.0):
        circle = FeltCircle(mu, 0.083, LabSettings(mus=(mu,)), "bank", degrees)
        circle.at(0.9 * closed_form("bank", degrees, mu, circle.radius))
        (across, along, load), data = circle.sums, circle.ground.data
        mujoco.mj_subtreeVel(circle.ground.model, data)
        body = circle.ground.model.body("car/base_link").id
        center, velocity = data.subtree_com[body], data.subtree_linvel[body]
        pull = (velocity @ velocity) / (GRAVITY * math.hypot(*center[:2]))
        assert math.hypot(across, along) / load == pytest.approx(abs((pull - slope) / (1.0 + pull * slope)), rel=0.02)


@each("radius", [4.0, 8.0])
def test_a_car_leaves_the_ground_of_a_crest_at_the_speed_of_the_closed_form(radius):
    """At v^2 = g r of its centre of gravity: the load that is left at the top is 1 - v^2 / g r of the weight."""
    arc = 0.4 * radius  # to either side of the top; before and behind it the slope stays
    ground = OnHeights(
        lambda x, y: np.sqrt(radius**2 - np.minimum(np.abs(x), arc) ** 2)
        - np.maximum(np.abs(x) - arc, 0.0) * arc / math.sqrt(radius**2 - arc**2),
    )  # fmt: skip
    own = ground.car.parameters
    lever = radius + own.center_of_gravity_height
    speed, loads, ways = 0.9 * math.sqrt(GRAVITY * lever), [], []
    ground.place(-arc - 1.0, speed=speed)
    while (middle := ground.data.qpos[0] + own.rear_axle_distance) < 0.3:
        ground.hold(ground.model.opt.timestep, 0.0, speed)
        if abs(middle) < 0.3:
            loads.append(ground.tires[:, LOAD].sum() / (own.mass * GRAVITY))
            ways.append(np.linalg.norm(ground.data.qvel[:3]))
    assert 0.2 < np.mean(loads) < 0.4
    assert np.mean(ways) ** 2 / (1.0 - np.mean(loads)) == pytest.approx(GRAVITY * lever, rel=0.02)
    ground.place(-arc - 1.0, speed=1.2 * speed)  # faster than that it flies
    off = 0
    while ground.data.qpos[0] < 0.3:
        ground.hold(ground.model.opt.timestep, 0.0, 1.2 * speed)
        off += ground.tires[:, LOAD].sum() == 0.0
    assert off * ground.model.opt.timestep > 0.05


def test_up_a_ramp_the_tires_push_what_the_height_takes():
    """Energy: at a steady speed they do the work of lifting the car, m g sin a a metre."""
    angle = math.radians(10.0)
    ground = OnHeights(lambda x, y: math.tan(angle) * x, reach=14.0)
    ground.place(-8.0, speed=2.0)
    ground.hold(2.0, 0.0, 2.5)
    start, work = ground.data.qpos[2], 0.0
    kinetic = 0.5 * ground.car.parameters.mass * np.sum(ground.data.qvel[:3] ** 2)
    for _ in range(400):
        before = ground.data.qpos[:3].copy()
        ground.hold(ground.model.opt.timestep, 0.0, 2.5)
        work += ground.tires[:, FORCE_ALONG].sum() * np.linalg.norm(ground.data.qpos[:3] - before)
    lifted = ground.car.parameters.mass * GRAVITY * (ground.data.qpos[2] - start)
    lifted += 0.5 * ground.car.parameters.mass * np.sum(ground.data.qvel[:3] ** 2) - kinetic
    assert work == pytest.approx(lifted, rel=0.01)


@each("name", ["oval", "hairpins"])
def test_level_ground_given_as_heights_is_driven_to_the_bit_as_the_plane(name):
    course = fg.load_track(name)
    given = replace(course, relief=Relief(heights=np.zeros((3, 4)), cell=10.0))
    races = [fg.race(each_of, laps=1) for each_of in (course, given)]
    assert races[0].trajectory_sha256 == races[1].trajectory_sha256
    assert np.array_equal(races[0].car.telemetry, races[1].car.telemetry, equal_nan=True)


@each("road", ["A", "C", "D"])
def test_a_rough_road_has_the_spectrum_of_its_class_at_our_scale(road):
    course = fg.load_track("oval")
    heights = [replace(course, relief=Relief(roughness=road, seed=seed)).ground.heights for seed in range(6)]
    spacing, rows = 0.05, np.concatenate(heights)
    rows = rows[:, : rows.shape[1] // 2 * 2] - rows.mean(axis=1, keepdims=True)
    window = np.hanning(rows.shape[1])
    power = np.abs(np.fft.rfft(rows * window, axis=1)) ** 2
    density = 2.0 * spacing * power.mean(axis=0) / (window**2).sum()
    waves = np.fft.rfftfreq(rows.shape[1], spacing)
    band = (waves > 0.5) & (waves < 3.0)
    asked = ROUGHNESS[road] * SCALE * (0.1 / waves[band]) ** 2 / 0.1**2 * 0.1**2
    assert np.exp(np.mean(np.log(density[band] / asked))) == pytest.approx(1.0, rel=0.25)


GROUNDS = ("oval[bank=10,kerb=0.01,cable_bridge=0.01]", "oval[ramp=8,walls=duct,height=0.2,room=3]",
           "oval[crest=0.1,roughness=C,ground_seed=4]")  # fmt: skip


@each("name", GROUNDS)
def test_walls_stand_on_it(name):
    course = fg.load_track(name)
    model = World(course).model
    geom = model.geom("ducts" if course.built else "walls")
    mesh, turn = geom.dataid[0], np.empty(9)
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    mujoco.mju_quat2Mat(turn, geom.quat)
    at = model.mesh_vert[first : first + count] @ turn.reshape(3, 3).T + geom.pos
    above = at[:, 2] - course.ground.at(at[:, :2])
    height = course.built.height if course.built else WALL_HEIGHT
    assert (above.min(), above.max()) == pytest.approx((0.0, height), abs=1e-5)


OF_FILES = ("walls=duct,height=0.2,gap=0.2,room=3", "bank=8,walls=duct,height=0.2", "crest=0.1,roughness=B")


SETTINGS_OF_FILES = ("walls=duct,height=0.2,gap=0.2,room=3", "bank=8,walls=duct,height=0.2", "crest=0.1,roughness=B")


def hills(x, y):
    return 0.05 * np.sin(x) * np.cos(y)


@each("name", [
    *GROUNDS, "oval[walls=duct,height=0.2,room=5]", "oval[gap=0.3,piece=2]", "oval[porosity=0.3,room=3]",
    "random:7[walls=duct,height=0.33,gap=0.1,room=3,clutter=5]", "{kinds}[height=0.4,room=2]",
    *(f"{{{kind}}}[{settings}]" for kind in ("map", "line") for settings in SETTINGS_OF_FILES),
    *(f"{name}[heights={{hills}},corner=-8:-4]" for name in ("open_ground:2", "scene:narrow_gap_150:1")),
])  # fmt: skip
def test_a_course_with_walls_or_ground_is_made_again_and_a_run_on_it_is_replayed(name, tmp_path):
    if "{map}" in name:
        draw_map(tmp_path, ring(), origin=(-7.5, -2.0, 0.0))
    elif "{kinds}" in name:
        draw_walls(tmp_path, 0.5)
    write_centreline(fg.load_track("oval"), tmp_path / "own.csv")
    np.save(tmp_path / "own.npy", hills(*np.meshgrid(np.arange(-8.0, 8.0, 0.1), np.arange(-4.0, 4.0, 0.1))))
    files = {"map": "drawn.yaml", "kinds": "drawn.yaml", "line": "own.csv", "hills": "own.npy"}
    name = name.format(**{kind: tmp_path / file for kind, file in files.items()})
    course, plain = fg.load_track(name), fg.load_track(name.partition("[")[0])
    again = course_of(course.name, course.definition)
    assert course.name == plain.name + name[name.index("[") :]
    solids = [[solid.corners() for solid in (*each.walls, *getattr(each, "hall", ()))] for each in (course, again)]
    assert all(np.array_equal(*both) for both in zip(*solids, strict=True))
    assert course.ground is again.ground is None or np.array_equal(course.ground.heights, again.ground.heights)
    assert all(np.array_equal(*both) for both in zip(course.edges, plain.edges, strict=True))
    lines = np.concatenate([segments(edge) for edge in course.edges]) if course.closed else ()
    for face in np.concatenate([wall.corners()[:2] for wall in course.walls if course.closed] or [()]):
        assert distance_to_segment(np.tile(face, (len(lines), 1)), *lines.transpose(1, 0, 2)).min() < 1e-9
    if not course.closed:
        places = np.array([[0.3, 0.2], [1.7, -1.1], [-2.0, 1.0]])
        assert course.ground.at(places) == pytest.approx(hills(*places.T), abs=1e-3)
    result = fg.race(course, laps=1 if course.closed else None, time_limit=4.0 if course.ground else None)
    assert result.car.finished or course.ground
    assert fg.replay(write_run(result, tmp_path / "run")).identical


@each("name, randomize", [
    ("oval[roughness=C,bank=3,walls=duct,height=0.2,gap=0.1,room=3]", {"mu": (0.8, 1.0), "through_cars": (0.0, 0.5)}),
    ("oval[walls=duct,height=0.2,weight=1,gap=0.05,room=3]", {"mu": (0.5, 1.0)}),
    ("oval[walls=duct,height=0.2,room=3,porosity=0.2]", {"floor_angle": (0.0, 0.2)}),
])  # fmt: skip
def test_a_world_of_a_rollout_there_is_the_race_that_its_setup_says(name, randomize, tmp_path):
    """Several worlds are stepped as cars alone, without what is only seen."""
    worlds = fg.rollout(
        name, n=3, time_limit=3.0, laps=1, out=tmp_path / "worlds", record="telemetry", workers=2, randomize=randomize,
    )  # fmt: skip
    for world in range(3):
        race = fg.race(worlds.setup(world))
        assert np.array_equal(race.car.telemetry, worlds.telemetry(world), equal_nan=True)


@each("degrees", [5.0, 15.0])
@each("name", ["ipz33", "hangar", "jfr_v6", "rca2"])
def test_the_banks_of_raced_maps_have_no_steps_where_stretches_meet(name, degrees):
    course = fg.load_track(f"{real_map(f'race_maps/{name}')}[bank={degrees}]")
    heights, cell = course.ground.heights, course.ground.cell
    most = 1.2 * math.tan(math.radians(degrees)) + 0.1
    assert max(np.abs(np.diff(heights, axis=axis)).max() for axis in (0, 1)) <= most * cell
    assert np.ptp(heights) > 0.5 * math.tan(math.radians(degrees)) * course.corridor_left.min()


@each("text", [
    "walls=round", "height=0", "height=high", "walls=duct,thickness=0.1", "clutter=3", "height=0.2,height=0.3",
    "porosity=2", "gap=-1", "room=0.3,clutter=400", "piece=nan,gap=0.1", "height=0.2,scale=2", "wall=duct",
    "weight=-1", "room_height=2", "piece=3", "bank=40", "ramp=30", "roughness=E", "bank=x", "heights=none.npy",
    "kerb=0.2", "cable_bridge=-0.1", "cell=0.2", "corner=1:1", "oval[height=0.2", "random:3[gaps=1]",
    "scene:narrow_gap_150:1[height=0.2]", "scene:narrow_gap_150:1[bank=3]", "open_ground:2[roughness=C]",
    "open_ground:2[bank=3]", "hairpins[ramp=0.5]", "fast[cable_bridge=0.02]", "gap=99", "weight=2,piece=0.1",
])  # fmt: skip
def test_settings_of_walls_and_ground_that_cannot_be_are_refused_in_a_line(text):
    with pytest.raises(TrackError, match="accepted") as refused:
        course = fg.load_track(text if "[" in text else f"oval[{text}]")
        _ = course.ground, course.hall, World(course)
    assert "\n" not in str(refused.value)


@each("bits", [8, 16])
def test_a_grey_picture_is_read_as_heights_with_all_its_bits_and_its_first_row_above(bits, tmp_path):
    rng, most = np.random.default_rng(5), 2**bits - 1
    levels = rng.integers(0, most, (40, 60), endpoint=True).astype(np.uint16 if bits == 16 else np.uint8)
    levels[0, :2] = 0, most
    Image.fromarray(levels).save(tmp_path / "own.png")
    name = f"open_ground:2[heights={tmp_path}/own.png,low=-0.02,high=0.05,cell=0.5,corner=-5:-6]"
    course = fg.load_track(name)
    rows, columns = np.mgrid[:40, :60]
    places = np.stack((-5.0 + 0.5 * columns, -6.0 + 0.5 * (39 - rows)), axis=-1)
    assert course.ground.at(places) == pytest.approx(-0.02 + 0.07 * levels / most, abs=1e-12)


def test_files_that_are_no_heights_are_refused_in_a_line(tmp_path):
    Image.new("RGB", (9, 9)).save(tmp_path / "colour.png")
    Image.new("L", (9, 9)).save(tmp_path / "grey.png")
    (tmp_path / "text.png").write_text("no picture")
    np.save(tmp_path / "complex.npy", np.full((9, 9), 1.0j))
    np.save(tmp_path / "own.npy", np.zeros((9, 9)))
    np.save(tmp_path / "high.npy", np.full((900, 900), 1e9))
    for text, said in (
        ("heights={}/colour.png,high=1", "RGB.*grey PNG of 8 or 16 bits"), ("heights={}/grey.png", "high"),
        ("heights={}/text.png,high=1", "accepted"), ("heights={}/none.png,high=1", "No such file"), ("low=1", "grey"),
        ("heights={}/complex.npy", "accepted: .*real numbers"),
        ("heights={}/high.npy", "row 0, column 0; accepted: -1000 to 1000 m"),
        ("heights={}/own.npy,corner=500:9", r"x 500\.0 to 500\.8 m, .*accepted: .* x -13\.1 to"),
    ):  # fmt: skip
        with pytest.raises(TrackError, match=said) as refused:
            _ = fg.load_track(f"oval[{text.format(tmp_path)}]").ground
        assert "\n" not in str(refused.value)


@each(("name", "value"), (("built", "duct"), ("relief", {"bank": 5})))
def test_what_is_no_walls_or_ground_is_refused(name, value):
    with pytest.raises(TrackError, match=f"Track.{name} is .*; accepted: "):
        replace(fg.load_track("oval"), **{name: value})


@each(("text", "least", "most"), [
    ("crest=0.5", 0.0, 0.5), ("crest=-0.3", -0.3, 0.0), ("ramp=20", 0.0, 0.25), ("kerb=0.05", 0.0, 0.05),
    ("cable_bridge=0.1", 0.0, 0.1),
])  # fmt: skip
def test_ground_is_as_high_as_it_was_told(text, least, most):
    heights = fg.load_track(f"oval[{text}]").ground.heights
    assert (heights.min(), heights.max()) == pytest.approx((least, most), abs=0.001)


def test_kerbs_rise_along_both_walls_of_bends_and_a_cable_bridge_crosses_a_straight():
    course = fg.load_track("oval[kerb=0.01,cable_bridge=0.02]")
    plain = fg.load_track("oval")

    def across(place, offsets):
        x, y, heading = plain.start_pose(place)
        points = np.array([x, y]) + np.outer(offsets, (-math.sin(heading), math.cos(heading)))
        return course.ground.at(points)

    places = np.arange(0.0, plain.length, 0.02)
    along = np.array([across(place, [0.0])[0] for place in places])
    bridge = along > 0.001
    assert 0.02 * bridge.sum() == pytest.approx(0.02 * 10.0 - 2 * 0.003, abs=0.05)  # a top of 4 heights, slopes of 3
    middle = places[bridge].mean()
    assert across(middle, [-0.9, -0.4, 0.5, 0.9]) == pytest.approx(0.02, abs=1e-6)
    half = 1.1  # of the road
    curvature = np.interp(places, plain.arc_length, plain.curvature, period=plain.length)
    bend, straight = places[np.abs(curvature).argmax()], middle + 1.5
    for side in (-1.0, 1.0):
        assert across(bend, side * (half - np.array([0.05, 0.2, 0.3]))) == pytest.approx((0.01, 0.005, 0.0), abs=1.5e-3)
    assert across(straight, [-half + 0.05, half - 0.05]) == pytest.approx(0.0, abs=1e-9)


def test_heights_with_a_hole_or_in_centimetres_and_tires_on_contacts_are_refused_with_the_place(tmp_path):
    with pytest.raises(SettingsError, match=r"nan in row 1, column 2"):
        Relief(heights=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, math.nan]]))
    steps = 10.0 * (np.arange(400) % 2) * np.ones((200, 1))
    with pytest.raises(TrackError, match=r"slope of 8\d deg at \("):
        _ = replace(fg.load_track("oval"), relief=Relief(heights=steps, corner=(-10.0, -10.0))).ground
    with pytest.raises(SettingsError, match="contact"):
        World("oval[bank=5]", tires="contact")
    with pytest.raises(SettingsError, match="things that move"):
        World("oval[bank=5,weight=2]")
    with pytest.raises(SettingsError, match="floor_angle on ground that is not level"):
        fg.race("oval[bank=5]", floor_angle=0.1)
    np.save(tmp_path / "own.npy", np.zeros((4, 4)))
    assert fg.load_track(f"oval[heights={tmp_path}/own.npy,cell=10]").ground.flat
