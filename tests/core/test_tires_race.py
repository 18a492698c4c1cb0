"""Tires with a curve at every door: races, replays, rollouts, environments, scenes, the live view, the command line."""

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.simulation.cars import CAR_PREFIX
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.vehicle.tires import Tires
from vehicle_worlds import open_file

NUC2 = "forzaeth_nuc2"


@pytest.fixture(scope="module")
def lap():
    return fg.race("oval", laps=1, tires=NUC2)


def test_a_vehicle_names_its_own_tires(tmp_path):
    text = (fg.vehicle.vehicle.files("fg_mujoco.models") / "f1tenth.xml").read_text("utf-8")
    path = tmp_path / "own.xml"
    path.write_text(text.replace("<custom>", '<custom><text name="tires" data="forzaeth_nuc6"/>'))
    vehicle = fg.Vehicle.load(path)
    assert vehicle.tires == Tires.load("forzaeth_nuc6") and vehicle.nominal_mu == vehicle.tires.least_peak
    assert fg.World("oval", vehicle).car.mu == pytest.approx(vehicle.tires.peak, rel=1e-5)
    assert fg.World("oval", vehicle, tires="contact").xml != fg.World("oval", vehicle).xml
    assert fg.World("oval", vehicle, tires="contact").car.mu == 1.0489
    path.write_text(text.replace("<custom>", '<custom><text name="tires" data="nuc6"/>'))
    with pytest.raises(fg.ModelError, match=r"own.xml: text 'tires': tires 'nuc6' are not known; accepted: contact"):
        fg.Vehicle.load(path)


@each("tires", ["contact", "coulomb", NUC2])
def test_telemetry_has_load_force_and_slip_of_each_tire_at_the_state_of_the_row(tires, lap):
    vehicle = open_file() if tires == "contact" else "f1tenth"  # a shaft winds up on contacts until tires hop
    lap = lap if tires == NUC2 else fg.race("oval", vehicle=vehicle, laps=1, tires=tires)
    wheels = fg.vehicle.car.WHEELS
    load, fx, fy, angle, ratio = (
        np.array([lap.car.column(name.format(wheel)) for wheel in wheels])
        for name in ("load_{}_N", "fx_{}_N", "fy_{}_N", "slip_angle_{}_rad", "slip_ratio_{}")
    )
    car = lap.world.parameters
    assert np.median(load.sum(axis=0)) == pytest.approx(car.mass * 9.81, rel=0.01)
    rolling = np.abs(lap.car.column("speed_m_s")) > 1.0
    assert np.isfinite(angle[:, rolling]).all() and np.isfinite(ratio[:, rolling]).all()
    # Newton: the car's mass times its lateral acceleration v r, by the tires' forces turned by the steering
    steering = lap.car.column("steering_angle_rad")
    side = fy[2:].sum(axis=0) + fy[:2].sum(axis=0) * np.cos(steering) + fx[:2].sum(axis=0) * np.sin(steering)
    needed = car.mass * lap.car.column("speed_m_s") * lap.car.column("yaw_rate_rad_s")
    assert np.corrcoef(side[rolling], needed[rolling])[0, 1] > 0.98
    assert (np.sign(angle) == np.sign(fy))[:, np.abs(fy).min(axis=0) > 2.0].mean() > 0.99
    engine = Engine(lap.world)
    engine.load(lap.states[150])
    engine.drive(controls=lap.ctrl[150:151])
    slip = engine.slip()
    again = [engine.telemetry[0][fg.TELEMETRY.index(f"load_{wheel}_N")] for wheel in wheels]
    assert again == slip[2, 0].tolist() == load[:, 150].tolist()


ICE = fg.Patch(x=6.0, y=0.0, length=3.0, width=2.0, mu=0.15)


@each("tires", ["contact", "coulomb", NUC2])
def test_a_tire_on_a_patch_has_the_friction_of_the_patch(tires):
    simulation = fg.Simulation(fg.World("oval", tires=tires, patches=(ICE,)))
    simulation.reset(s=5.0, speed=3.0)
    simulation.drive(0.0, 3.0)
    own = simulation.engine.floor_friction()
    under = [ICE.mu] * 4 if tires != NUC2 else [ICE.mu, ICE.mu, *2 * [ICE.mu * 0.96465 / 1.2307]]
    np.testing.assert_allclose(own[-1], under, rtol=1e-4)
    if tires == "contact":
        pairs = [simulation.world.model.pair(f"{CAR_PREFIX}{wheel}_tire").id for wheel in fg.vehicle.car.WHEELS]
        assert simulation.world.model.pair_friction[pairs, 0].tolist() == own[-1].tolist()
