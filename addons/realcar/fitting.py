"""Computes from a vehicle's masses and lengths its rest position, its steering geometry and the strength of its drive.

The numbers of the bundled vehicles are those that `fit` gives, and the tests hold them to it.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from fg_mujoco.errors import ModelError
from fg_mujoco.messages import FloatArray
from fg_mujoco.vehicle.car import WHEELS, car_parameters
from fg_mujoco.vehicle.contract import ackermann_angle

_BODY_HEIGHT = 0.10  # [m] of the chassis, which its roll and pitch inertia follow from


def fit(spec: Any, *, mass: float, center_of_gravity: tuple[float, float], yaw_inertia: float) -> None:
    """Give a vehicle's spec masses, and all that follows from these and from its lengths, in place.

    Written are the chassis' `inertial`, and the place of the accelerometer, which is in the centre of gravity; the
    tires' sizes, the height of base_link and the suspensions' `springref`: the car rests as it is drawn; the Ackermann
    equality of each side; gain and force of the drive: its greatest acceleration and its time constant stay what they
    were. The spec is built as models/f1tenth.xml. Of the whole car are `mass` [kg], `center_of_gravity`, ahead of the
    rear axle and over the ground [m], and `yaw_inertia` about it [kg m^2]. Raises ModelError: more mass or inertia in
    the wheels and axles than in the whole car.
    """
    before = car_parameters(spec.compile())
    inertia = whole_inertia(mass, yaw_inertia, before.length, before.width)
    for _ in range(3):  # what the tires give depends on the chassis, whose place depends on what they give
        _fit_chassis(spec, mass, center_of_gravity, inertia)
        _fit_stance(spec, mass, before.wheel_radius, before.gravity)
    _fit_springs(spec, before.gravity)
    limit = before.max_steering_angle
    for side, sign in (("left", 1.0), ("right", -1.0)):
        coefficients = ackermann_quartic(before.wheelbase, sign * before.track_width, limit)
        spec.equality(f"ackermann_{side}").data[:5] = (0.0, *coefficients)
    after = car_parameters(spec.compile())
    # both were worked out with the drive as it was; what they differ by is the ratio of the effective masses
    heavier = before.max_acceleration / after.max_acceleration
    drive = spec.actuator("speed")
    drive.forcerange = [heavier * value for value in drive.forcerange]
    drive.gainprm = [heavier * value for value in drive.gainprm]
    drive.biasprm = [heavier * value for value in drive.biasprm]


def whole_inertia(mass: float, yaw_inertia: float, length: float, width: float) -> FloatArray:
    """Return roll, pitch and yaw inertia of a whole car about its centre of gravity (3,) [kg m^2].

    The yaw inertia is shared as in a plate of the car's length and width; roll and pitch have m h^2 / 12 of a car that
    is .10 m tall besides.
    """
    roll = yaw_inertia * width**2 / (length**2 + width**2)
    upright = mass * _BODY_HEIGHT**2 / 12.0
    return np.array([roll + upright, yaw_inertia - roll + upright, yaw_inertia])


def ackermann_quartic(wheelbase: float, track_width: float, limit: float) -> FloatArray:
    """Return the polynomial c1 d + c2 d^2 + c3 d^3 + c4 d^4 of a wheel's angle over the steering angle d (4,) [rad].

    A wheel that rolls on a circle about the middle of the turn has tan(a) = tan(d) / (1 - tan(d) w / (2 b)), with the
    track width w [m] negative for the right wheel, and the wheelbase b [m]. The quartic has the least greatest error on
    +-`limit` [rad]. Source: Lawson, Contributions to the theory of linear least maximum approximation, 1961.
    """
    angles = np.linspace(-limit, limit, 401)
    exact = ackermann_angle(angles, wheelbase, track_width)
    powers = angles[:, None] ** np.arange(1, 5)
    weights = np.full(len(angles), 1.0 / len(angles))
    least, best = np.inf, np.zeros(4)
    for _ in range(1000):
        root = np.sqrt(weights)
        coefficients = np.linalg.lstsq(powers * root[:, None], exact * root, rcond=None)[0]
        error = np.abs(powers @ coefficients - exact)
        if error.max() < least:
            least, best = float(error.max()), coefficients
        weights *= error
        weights /= weights.sum()
    return best


def tire_stiffness(model: Any) -> FloatArray:
    """Return the stiffness of the spring that the engine makes of each tire's contact (4,) [N/m].

    At rest the contact's reference acceleration, k d depth with k = 1 / (d time_constant damping_ratio)^2, is that of
    the regularised force, R F with R = (1 - d) / d / effective mass (MuJoCo's "Computation", of constraints).
    """
    pairs = [model.pair(f"{wheel}_tire").id for wheel in WHEELS]
    (time_constant, damping_ratio), impedance = model.pair_solref[pairs].T, model.pair_solimp[pairs, 0]
    inverse_mass = model.body_invweight0[[model.body(f"{wheel}_wheel").id for wheel in WHEELS], 0]
    stiffness: FloatArray = 1.0 / ((time_constant * damping_ratio) ** 2 * (1.0 - impedance) * inverse_mass)
    return stiffness


def _fit_stance(spec: Any, mass: float, wheel_radius: float, gravity: float) -> None:
    """Place the middles of the wheels half of what the tires give below the radius that they roll on."""
    give = 0.25 * mass * gravity / float(tire_stiffness(spec.compile()).mean())  # [m]
    for wheel in WHEELS:
        tire = spec.geom(f"{wheel}_tire")
        tire.size = (wheel_radius + 0.5 * give, tire.size[1], wheel_radius + 0.5 * give)
    base = spec.body("base_link")
    base.pos = (base.pos[0], base.pos[1], wheel_radius - 0.5 * give)


def _fit_chassis(spec: Any, mass: float, center_of_gravity: tuple[float, float], inertia: FloatArray) -> None:
    """Give the chassis what is left of the whole car when all other bodies are taken off."""
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    base = model.body("base_link").id
    center = data.xpos[base] + (center_of_gravity[0], 0.0, center_of_gravity[1] - data.xpos[base, 2])
    others = np.flatnonzero((model.body_rootid == base) & (np.arange(model.nbody) != base))
    masses = model.body_mass[others]
    left = mass - float(masses.sum())
    if left <= 0.0:
        raise ModelError(f"a car of {mass:g} kg; accepted: more than {masses.sum():.3g} kg, its wheels and axles")
    place = (mass * center - masses @ data.xipos[others]) / left
    own = np.einsum("bki,bi->bk", data.ximat[others].reshape(-1, 3, 3) ** 2, model.body_inertia[others]).sum(axis=0)
    rest = inertia - own - masses @ _levers(data.xipos[others] - center) - left * _levers(place - center)
    if not (rest > 0.0).all() or 2.0 * rest.max() > rest.sum():
        raise ModelError(
            f"a chassis of inertia {rest.round(6)} kg m^2; accepted: one that a body can have, of more yaw inertia"
        )
    chassis = spec.body("base_link")
    chassis.mass, chassis.ipos, chassis.inertia = left, place - data.xpos[base], rest
    chassis.iquat, chassis.explicitinertial = (1.0, 0.0, 0.0, 0.0), True
    spec.site(spec.sensor("accelerometer").objname).pos = center - data.xpos[base]


def _levers(places: FloatArray) -> FloatArray:
    """Return the squares of the distances from the x, y and z axes (..., 3) [m^2]."""
    squares = places**2
    return np.asarray(squares.sum(axis=-1, keepdims=True) - squares)


def _fit_springs(spec: Any, gravity: float) -> None:
    """Give each suspension the rest position in which its spring carries half the axle's load less what is unsprung."""
    model = spec.compile()
    car = car_parameters(model)
    for axle, lever in (("front", car.rear_axle_distance), ("rear", car.front_axle_distance)):
        load = 0.5 * car.mass * gravity * lever / car.wheelbase  # [N] of a wheel
        for side in ("left", "right"):
            joint = model.joint(f"{axle}_{side}_suspension")
            unsprung = float(model.body_subtreemass[joint.bodyid[0]])
            stiffness = float(model.jnt_stiffness[joint.id])
            spec.joint(f"{axle}_{side}_suspension").springref = -(load - unsprung * gravity) / stiffness
