"""The model-predictive tracker: its program against other solvers, its models against equations, and its plans."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import minimize
from test_pure_pursuit import CAR, OPEN, at, pursuer

from cases import each
from fg_mujoco.addons.drivers import line_mpc, ltv_program
from fg_mujoco.addons.drivers.line_mpc import DT, STEPS
from fg_mujoco.addons.drivers.line_profile import LEFT, RIGHT, X
from fg_mujoco.addons.drivers.ltv_program import HIGH, INPUT, LAST, LOW, SOFTNESS
from fg_mujoco.addons.drivers.pure_pursuit import PurePursuit, PurePursuitSettings
from fg_mujoco.controllers.control.slip import steered
from fg_mujoco.messages import ODOMETRY, MapLine

STRAIGHT = MapLine(points=np.array([[0.0, 0.0], [60.0, 0.0]]), closed=False)
SOFT = replace(CAR, front_cornering_stiffness=4.7, rear_cornering_stiffness=5.5, front_peak=1.0, rear_peak=1.0,
               relaxation_length=0.01)  # fmt: skip


def a_program(seed, count=6):
    """Return a random program whose input has hard bounds, and the other bounded values soft ones."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(2, 6))
    system = [0.4 * rng.normal(size=(count, size, size)), rng.normal(size=(count, size))]
    program = [*system, 0.2 * rng.normal(size=(count, size)), rng.uniform(0, 2, (count + 1, size))]
    limits = np.stack([-rng.uniform(0.1, 0.6, (count, 4)), rng.uniform(0.1, 0.6, (count, 4)), np.zeros((count, 4))])
    limits[SOFTNESS, :, 1:] = 1.0 / rng.uniform(1.0, 50.0, (count, 3))
    return [*program, rng.uniform(0.1, 1.0, count), rng.normal(size=count), limits, rng.normal(size=size)]


def solved(program, most=30):
    """Return the steps that the solver took, the inputs, and the states."""
    inputs, states = np.empty(len(program[1])), np.empty(program[3].shape)
    return ltv_program.solve_program(tuple(program), inputs, states, most), inputs, states


def rolled_out(program, inputs):
    a, b, c, start = *program[:3], program[7]
    states = [start]
    for k, u in enumerate(inputs):
        states.append(a[k] @ states[-1] + b[k] * u + c[k])
    return np.array(states)


def cost_of(program):
    weights, effort, coupling, limits = program[3:7]

    def cost(inputs):
        states = rolled_out(program, inputs)
        values = np.stack([inputs + coupling * states[:-1, -1], states[1:, -1], states[1:, 0]], axis=1)
        beyond = np.maximum(values - limits[HIGH, :, 1:], 0.0) + np.maximum(limits[LOW, :, 1:] - values, 0.0)
        soft = np.sum(beyond**2 / limits[SOFTNESS, :, 1:])
        return 0.5 * (np.sum(weights * states**2) + np.sum(effort * inputs**2) + soft)

    return cost


def test_the_program_is_solved_as_by_a_bounded_quasi_newton_method():
    hard = soft = 0
    for seed in range(12):
        program = a_program(seed)
        iterations, inputs, states = solved(program)
        low, high = program[6][[LOW, HIGH], :, INPUT]
        options = {"ftol": 1e-15, "gtol": 1e-10, "maxiter": 5000}
        bounds = list(zip(low, high, strict=True))
        best = minimize(cost_of(program), np.zeros(6), bounds=bounds, method="L-BFGS-B", options=options)
        assert 0 < iterations <= 20
        assert inputs == pytest.approx(best.x, abs=2e-3)
        assert states == pytest.approx(rolled_out(program, inputs), abs=1e-12)
        assert cost_of(program)(inputs) == pytest.approx(best.fun, rel=1e-5)
        hard += np.sum((best.x == low) | (best.x == high))
        soft += np.sum(np.abs(states[1:, 0]) > 0.6)
    assert hard > 5 and soft > 5


def test_a_program_without_a_solution_and_one_that_is_not_finite_do_not_converge():
    program = a_program(0)
    program[6][SOFTNESS] = 0.0
    program[6][LOW, :, LAST], program[6][HIGH, :, LAST] = 5.0, 6.0
    assert solved(program)[0] == 0
    program = a_program(0)
    program[7][0] = math.nan
    assert solved(program)[0] == 0
    assert solved(a_program(0), most=2)[0] == 0


def ahead_of(speed, curvature, car=CAR):
    ahead = np.zeros((STEPS + 1, 6))
    ahead[:, 0], ahead[:, 1], ahead[:, 2] = speed, speed * DT * curvature, curvature
    ahead[:, 3] = math.atan(car.wheelbase * curvature)
    return ahead


def system_of(planner, ahead, size):
    driver = planner.driver[0]
    a, b, c = np.zeros((STEPS, size, size)), np.zeros((STEPS, size)), np.zeros((STEPS, size))
    if size == 5:
        line_mpc.single_track(ahead, driver, a, b, c)
    else:
        line_mpc.kinematic(ahead, driver["car"], a, b, c)
    return a[0], b[0], c[0]


@each("speed, curvature", [(2.0, 0.8), (6.0, -0.15), (8.0, 0.0)])
def test_the_kinematic_model_is_the_car_beside_a_circle(speed, curvature):
    a, b, c = system_of(pursuer(STRAIGHT), ahead_of(speed, curvature), 3)
    start, rate, parts = np.array([0.01, -0.02, 0.01]), 0.3, 2000
    e, angle, steering = start[0], start[1], start[2] + math.atan(CAR.wheelbase * curvature)
    for _ in range(parts):
        along = speed * math.cos(angle) / (1.0 - e * curvature)
        turning = speed * math.tan(steering + 0.5 * rate * DT / parts) / CAR.wheelbase - curvature * along
        e += DT / parts * speed * math.sin(angle)
        angle, steering = angle + DT / parts * turning, steering + DT / parts * rate
    expected = [e, angle, steering - math.atan(CAR.wheelbase * curvature)]
    assert a @ start + b * rate + c == pytest.approx(expected, abs=2e-4)


@each("speed", [1.0, 4.0, 8.0])
def test_the_single_track_model_is_the_exponential_of_its_equations(speed):
    planner = PurePursuit(SOFT, 1.0, 8.0, PurePursuitSettings(tracker="mpc"), map_line=STRAIGHT)
    a, b, c = system_of(planner, ahead_of(speed, 0.0, SOFT), 5)
    lf, lr, m, inertia = SOFT.front_axle_distance, SOFT.rear_axle_distance, SOFT.mass, SOFT.yaw_inertia
    front = 4.7 * m * SOFT.gravity * lr / SOFT.wheelbase  # [N/rad]
    rear = 5.5 * m * SOFT.gravity * lf / SOFT.wheelbase
    continuous = np.zeros((6, 6))  # of distance, angle, lateral speed, yaw rate, steering angle; and of the rate
    continuous[0, 1:4], continuous[1, 3], continuous[4, 5] = (speed, 1.0, -lr), 1.0, 1.0
    continuous[2, 2:5] = -(front + rear) / (m * speed), -(lf * front - lr * rear) / (m * speed) - speed, front / m
    yawing = -(lf * front - lr * rear) / speed, -(lf**2 * front + lr**2 * rear) / speed, lf * front
    continuous[3, 2:5] = np.array(yawing) / inertia
    limiter = planner.driver[0]["limiter"]
    continuous[2:4, 4] *= steered(limiter["slip"], limiter["car"], 0.01, speed) / 0.01
    exact = expm(DT * continuous)
    start, rate = np.array([0.1, 0.05, 0.1, 0.3, 0.05]), 0.3
    expected = exact[:5] @ np.append(start, rate)
    assert a @ start + b * rate + c == pytest.approx(expected, abs=0.012, rel=0.06)


def plan_of(planner):
    return planner.stage_state("mpc")


@each("offset", [0.3, -0.3])
def test_the_plan_turns_as_fast_as_the_friction_limiter_allows_and_no_faster(offset):
    speed, planner = 6.0, pursuer(STRAIGHT, tracker="mpc")
    command = planner(OPEN, at(10.0, offset, 0.0, speed))
    limiter, plan = planner.driver[0]["limiter"], plan_of(planner)
    share = 1.0 - math.exp(-0.025 / CAR.steering_time_constant)
    angles = plan["angles"]
    lateral = speed * speed * np.tan(angles[:-1]) / CAR.wheelbase
    left = limiter["lateral"] - np.sign(np.diff(angles)) * lateral
    response = limiter["settings"]["steering_response"] * share / 0.025
    rate = limiter["settings"]["turn_in_use"] * left * CAR.wheelbase / (limiter["yaw_lag"] * speed) * response
    used = np.abs(np.diff(angles)) / DT / rate
    assert used[0] == pytest.approx(1.0, abs=0.02) and used[:8].max() < 1.05
    wanted = angles[0] + 0.5 * (angles[1] - angles[0])  # after a tick, half a step of the plan
    assert command.steering_angle == pytest.approx(wanted / share, rel=0.03)
    assert math.copysign(1.0, command.steering_angle) == -math.copysign(1.0, offset)


def test_a_plan_begins_where_the_car_is_once_its_command_arrives():
    """After 50 ms of a steering angle that goes from .1 rad to the command before, against small steps."""
    planner = pursuer(STRAIGHT, tracker="mpc")
    row, odometry, plan = planner.driver[0]["car"].copy(), np.zeros(1, ODOMETRY), np.zeros(1, line_mpc.MPC)
    row["command_delay"], odometry["speed"], odometry["pose"] = 0.05, 4.0, (1.0, 2.0, 0.3)
    plan["planned"], plan["command"] = True, 0.2
    x, y, heading, angle, step = 1.0, 2.0, 0.3, 0.1, 1e-5
    for _ in range(5000):
        x, y = x + 4.0 * step * math.cos(heading), y + 4.0 * step * math.sin(heading)
        heading += 4.0 * step * math.tan(angle) / CAR.wheelbase
        angle += (0.2 - angle) * step / CAR.steering_time_constant
    found = line_mpc.place_at_command(odometry[0], row, 0.1, plan[0])
    assert found == pytest.approx((x, y, heading, angle), abs=0.015) and heading > 0.39


def test_a_plan_that_does_not_converge_is_replaced_by_the_last_one_and_then_by_braking():
    planner = PurePursuit(SOFT, 1.0, 8.0, PurePursuitSettings(tracker="mpc"), map_line=STRAIGHT)
    planner(OPEN, at(10.0, 0.2, 0.0, 4.0))
    names = [reason.name for reason in planner.reasons()]
    assert "last plan" not in names and "no plan" not in names
    angles, told = plan_of(planner)["angles"].copy(), []
    blind = replace(at(10.1, 0.2, 0.0, 4.0), angular_velocity=(0, 0, math.nan))
    for _ in range(45):
        planner(OPEN, blind)
        reference = planner._alone.references[0]
        (reason,) = (each for each in planner.reasons() if each.name in ("last plan", "no plan"))
        told.append((reason.name, reference["steering_angle"], reference["own_speed"]))
    share = 1.0 - math.exp(-0.025 / SOFT.steering_time_constant)
    assert [name for name, _, _ in told] == ["last plan"] * 39 + ["no plan"] * 6
    assert told[0][1] == pytest.approx(np.interp(0.05, DT * np.arange(STEPS + 1), angles) / share, rel=1e-6)
    assert told[-1][1] == pytest.approx(angles[-1] / share, rel=1e-6)
    assert told[0][2] > 1.0 and told[-1][2] == 0.0
    planner(OPEN, at(10.2, 0.2, 0.0, 4.0))
    assert not {"last plan", "no plan"} & {reason.name for reason in planner.reasons()}


@each("car", [CAR, replace(CAR, command_delay=0.05), SOFT])
def test_what_is_not_finite_brakes_and_is_forgotten(car):
    planner = PurePursuit(car, 1.0, 8.0, PurePursuitSettings(tracker="mpc"), map_line=STRAIGHT)
    good = at(10.0, 0.1, 0.0, 4.0)
    expected = planner(OPEN, good)
    for broken in (at(math.nan, 0.0, 0.0, 4.0), at(10.0, 0.0, 0.0, math.nan), at(10.0, 0.1, 0.0, 4.0, math.nan)):
        command = planner(OPEN, broken)
        assert command.steering_angle == 0.0 or not math.isnan(broken.speed)
        for _ in range(4):
            command = planner(OPEN, good)
        assert math.isfinite(command.steering_angle) and plan_of(planner)["iterations"] > 0
        assert command.steering_angle == pytest.approx(expected.steering_angle, abs=0.02)


@each("side", [1, -1])
def test_a_plan_keeps_to_the_room_beside_the_line_and_the_car_slows_where_it_cannot(side):
    planner, speed = pursuer(STRAIGHT, tracker="mpc"), 4.0
    odometry = np.zeros(1, ODOMETRY)
    odometry["speed"], odometry["pose"] = speed, (10.0, 0.0, 0.0)
    reached, slower = {}, {}
    for narrow in (math.inf, 12.0, 10.5):  # [m] along the line, from where on the car has to be 0.1 m beside it
        line, plan = planner.line.copy(), np.zeros(1, line_mpc.MPC)
        line[line[:, X] > narrow, LEFT if side > 0 else RIGHT] = -0.1 * side
        nearest = int(np.argmin(np.abs(line[:, X] - 10.0)))
        _, slower[narrow], state = line_mpc.plan_steering(line, nearest, odometry[0], planner.driver[0], 0.025, plan[0])
        assert state == line_mpc.SOLVED
        headings = np.cumsum(np.append(0.0, speed * DT * np.tan(plan[0]["angles"]) / CAR.wheelbase))
        reached[narrow] = np.sum(speed * DT * side * headings[:-2])
    assert reached[math.inf] == pytest.approx(0.0, abs=1e-3)
    assert reached[12.0] == pytest.approx(-0.1, abs=0.03)
    assert slower[math.inf] == slower[12.0] == math.inf and speed - 0.2 <= slower[10.5] < speed
