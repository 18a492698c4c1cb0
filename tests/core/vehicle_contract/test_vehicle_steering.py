"""What an MJCF says of steering, drive and tires: tires of ours obey it as MuJoCo's own step does."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.vehicle.steering_servo import _driven
from fg_mujoco.vehicle.tire_rows import peaks
from fg_mujoco.vehicle.tires import DEFAULT_TIRES
from vehicle_worlds import F1TENTH

STEERING = '<joint name="steering" type="hinge" axis="0 0 1" damping="0.954" armature="0.005"/>'
KINGPIN = '<joint type="hinge" axis="0 0 1" damping="0.023"/>'
SERVO = '<position name="steering" joint="steering" kp="50"'
LOOSE = (STEERING, STEERING.replace("0.954", "0.1"))
PLAIN_RATE = 3.2  # [rad/s] torque of the servo over 1 N m s/rad


def joint(said, part=STEERING):
    return (part, part.replace("/>", f" {said}/>"))


def quadratic(first, second, torque):
    return (-first + math.sqrt(first**2 + 4.0 * second * torque)) / (2.0 * second)


# what is said, and the greatest rate that follows [rad/s]; None: no closed form
SAID = {
    "nothing": ([], PLAIN_RATE),
    "damping of the servo": ([LOOSE, (SERVO, SERVO + ' damping="0.854"')], PLAIN_RATE),
    "an inertia of the servo": ([(SERVO, SERVO + ' armature="0.02"')], PLAIN_RATE),
    "kv": ([LOOSE, (SERVO, SERVO + ' kv="0.854"')], None),
    "dampratio": ([LOOSE, (SERVO, SERVO + ' dampratio="1"')], None),
    "no forcerange": ([(' forcerange="-3.2 3.2"', "")], None),
    "a polynomial of the joint": ([(STEERING, STEERING.replace('"0.954"', '"0.5 0.2"'))], quadratic(0.546, 0.2, 3.2)),
    "a polynomial of the kingpins": ([(KINGPIN, KINGPIN.replace('"0.023"', '"0.023 0.1"'))], None),
    "friction": ([joint('frictionloss="0.5"')], 2.7),
    "friction of the kingpins": ([joint('frictionloss="0.3"', KINGPIN)], None),
    "a spring": ([joint('stiffness="5" springref="0.2"')], None),
    "a limited force": ([joint('actuatorfrcrange="-1 1"')], 1.0),
    "a soft end": ([joint('range="-0.3 0.3"')], PLAIN_RATE),
    "an end with a margin": ([joint('range="-0.42 0.42" margin="0.1"')], PLAIN_RATE),
    "another zero": ([joint('ref="0.1"')], PLAIN_RATE),
    "soft kingpins": ([('solref="-30000 -300"', 'solref="0.1 1"')], None),
    "kingpins that are heavy": ([(KINGPIN, KINGPIN.replace("0.023", "0.3"))], None),
    "kingpins that turn by half": ([("0 1.00098", "0 0.5")], None),
    "a filter": ([(SERVO, SERVO + ' timeconst="0.05"')], PLAIN_RATE),
}


def car(tmp_path, changes):
    text = F1TENTH.replace('<text name="look" data="f1tenth_look.xml"/>', "")
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    (tmp_path / "car.xml").write_text(text, encoding="utf-8")
    return str(tmp_path / "car.xml")


def steered(file, **tires):
    """Return the angles of the steering and both kingpins at each tick of a move to one side and to the other."""
    simulation = fg.Simulation(fg.World(fg.OpenGround(seconds=5.0), file, **tires))
    simulation.reset(speed=0.0)
    names = ("steering", "front_left_kingpin", "front_right_kingpin")
    places, angles = [simulation.world.model.joint(f"car/{name}").qposadr[0] for name in names], []
    for command in (*[0.35] * 8, *[-0.35] * 8):
        simulation.step(fg.DriveCommand(steering_angle=command, speed=0.0))
        angles.append(simulation.data.qpos[places])
    return np.array(angles), simulation.world.parameters


@each("name", SAID)
@pytest.mark.filterwarnings("ignore:vehicle file:UserWarning")  # soft kingpins do not follow
def test_a_steering_turns_as_mujocos_own_step_turns_it_and_planners_are_told_its_rate(tmp_path, name):
    changes, rate = SAID[name]
    file = car(tmp_path, changes)
    (ours, parameters), (own, _) = steered(file), steered(file, tires="contact")
    assert np.abs(ours[:, 0] - own[:, 0]).max() < 0.004
    assert np.abs(ours[:, 1:] - own[:, 1:]).max() < 0.005
    seen = np.abs(np.diff(own[:, 0])).max() / 0.025
    assert 0.99 * seen <= parameters.max_steering_rate
    if rate is not None:
        assert parameters.max_steering_rate == pytest.approx(rate, rel=0.01)


@each(
    ("changes", "greatest"),
    [
        ([joint('range="-0.3 0.3"')], 0.3),  # its end gives way
        ([joint('range="-0.3 0.3" solreflimit="-30000 -300"')], 0.3),
        ([('ctrlrange="-0.4189', 'ctrlrange="-0.2')], 0.2),
        ([(SERVO, SERVO.replace("<position", '<general actlimited="true" actrange="-.2 .2" dyntype="filterexact" '
           'dynprm=".04" gainprm="50" biastype="affine" biasprm="0 -50"').replace(' kp="50"', ""))], 0.2),
        ([(SERVO, SERVO.replace("<position", '<general gainprm="50" biastype="affine" biasprm="2 -50"')
           .replace(' kp="50"', ""))], 0.4189),  # an offset is none
    ],
)  # fmt: skip
def test_planners_are_told_where_a_steering_ends(tmp_path, changes, greatest):
    parameters = fg.Vehicle.load(car(tmp_path, changes)).parameters
    assert parameters.max_steering_angle == pytest.approx(greatest, abs=0.014)


@each(
    ("before", "after", "share"),
    [
        ('<joint type="hinge" axis="0 1 0"', '<joint actuatorfrcrange="-.1 .1" type="hinge" axis="0 1 0"', 0.4 / 0.049),
        ('<fixed name="drive"', '<fixed name="drive" actuatorfrcrange="-9 9"', 9.0),
        ('forcerange="-39.449 39.449"', 'forcerange="-9 39.449"', 9.0),  # it brakes by no more
    ],
)
def test_a_limit_of_the_wheels_or_their_tendon_bounds_the_drive_and_planners_know(tmp_path, before, after, share):
    world = fg.World(fg.OpenGround(seconds=5.0), car(tmp_path, [(before, after)]), tires="coulomb")  # rolls freely
    simulation = fg.Simulation(world)
    simulation.reset(speed=4.0)
    for _ in range(20):
        simulation.step(fg.DriveCommand(steering_angle=0.0, speed=-5.0))
    told = simulation.world.parameters.max_acceleration
    assert told == pytest.approx(share / 4.14816, rel=1e-3)
    assert (4.0 - simulation.world.car.ground_speed(simulation.data)) / 0.5 == pytest.approx(told, rel=0.02)


def test_planners_know_the_filter_of_a_drive(tmp_path):
    drive = '<velocity name="speed" tendon="drive" kv="41.4816"'
    filtered = '<general name="speed" tendon="drive" dyntype="filter" dynprm="0.2" gainprm="41.4816" biastype="affine"'
    file = car(tmp_path, [(drive, f'{filtered} biasprm="0 0 -41.4816"')])
    assert fg.Vehicle.load(file).parameters.speed_time_constant == pytest.approx(0.3, rel=1e-5)


def test_a_steering_that_is_driven_to_be_measured_has_the_numbers_of_the_closed_form():
    model = fg.Vehicle.load("f1tenth").compile()
    lock, rate, time_constant = _driven(model, 0, model.joint("steering").id, 0.4189)
    assert (
        lock == 0.4189 and rate == pytest.approx(PLAIN_RATE, rel=0.01) and time_constant == pytest.approx(0.02, rel=0.1)
    )


def test_the_friction_of_each_axle_is_that_of_its_pairs(tmp_path):
    weak = 'friction="0.6 0.6 0 0 0"'
    weak, pairs = 'friction="0.6 0.6 0 0 0"', [f'<pair name="rear_{side}_tire"' for side in ("left", "right")]
    changes = [(pair, f"{pair} {weak}") for pair in pairs]
    world = fg.World(fg.OpenGround(seconds=5.0), car(tmp_path, changes))
    front = 1.0489 * fg.Tires.load(DEFAULT_TIRES).least_share
    assert peaks(world.model, "car/") == pytest.approx([front, front, 0.6, 0.6]) and world.vehicle.nominal_mu == 0.6
