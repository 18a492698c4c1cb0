"""Numbers of vehicles follow from their masses and lengths."""

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.realcar.fitting import fit
from fg_mujoco.vehicle.bodywork import add_hull
from vehicle_worlds import load


@each("name", (*fg.vehicle_names(), "made"))
def test_its_numbers_are_those_that_fitting_gives(name):
    """Of what a compiled model has; so that no number is left behind when another is changed."""
    vehicle = load(name)
    spec, limits = vehicle.spec(), vehicle.parameters
    fit(
        spec,
        mass=limits.mass,
        center_of_gravity=(limits.rear_axle_distance, limits.center_of_gravity_height),
        yaw_inertia=limits.yaw_inertia,
    )
    fitted, model = add_hull(spec).compile(), vehicle.compile()
    for array in ("body_mass", "body_ipos", "body_inertia", "body_pos", "geom_size", "site_pos", "qpos_spring",
                  "eq_data", "actuator_gainprm", "actuator_biasprm", "actuator_forcerange"):  # fmt: skip
        rounding = 4e-5 if array == "eq_data" else 3e-6
        assert getattr(model, array) == pytest.approx(getattr(fitted, array), rel=1e-4, abs=rounding), array
