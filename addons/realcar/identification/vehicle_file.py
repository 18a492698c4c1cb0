"""Writes the MJCF of an identified car: the vehicle that was assumed, with what its drives told in place.

Changed are, each only where the drives told it:

- the numeric `steering_map`, by which what the real servo is sent becomes the angle of the wheels, and the lag, the
  delay and the greatest angle of the steering servo, which is commanded that angle;
- the moments of inertia of the chassis, by the ratio that was found for the yaw inertia of the whole car;
- the speed servo's gain, time constant and delay, for a car that is commanded speeds; that of a car that is commanded
  accelerations is the vehicle's, and not late, because it closes its loop in the car;
- the damping of the wheels, by the drag that was found, and the numeric `acceleration_map`, for a car that is commanded
  accelerations;
- the text `tires`, which names the file of the identified tires.

All else stays, comments too. The rolling resistance is in the tires' file.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from fg_mujoco.course.documents import xml_comment
from fg_mujoco.course.writing import write_file
from fg_mujoco.errors import ModelError, SettingsError
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.command_response import ACCELERATION_MAP, STEERING_MAP
from fg_mujoco.vehicle.drive_line import DriveLine
from fg_mujoco.vehicle.vehicle import Vehicle

from .identification import Identification

_SAMPLES = 32  # of a servo's delay, as vehicle/changes.py has them
_STOP = {"limited": "true", "solreflimit": "-30000 -300", "solimplimit": "0.99 0.999 0.001"}
# where the steering ends: as stiff as the Ackermann equalities of the bundled vehicles
_SHORTEST_LAG = 0.01  # [s] of the steering: a shorter one is that of the vehicle's own servo
_STEP = 0.005  # [s] of the physics: delays below half of it are none


def vehicle_text(found: Identification, vehicle: Vehicle, *, name: str, tires: str) -> str:
    """Return the MJCF of the identified car, by a new name, on tires of a file in the same folder or of a bundled set.

    Raises ModelError: the vehicle's MJCF has its servos or wheels in another form than the bundled ones.
    """
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(vehicle.text, parser=parser)
    root.set("model", name)
    notes = _steering(root, found, vehicle)
    notes += _inertia(root, found, vehicle)
    notes += _speed(root, found, vehicle)
    _put(root, "text", "tires", tires)
    heading = [
        f"{name}: the vehicle {vehicle.name} with what `fg-mujoco identify` found (see docs/addons/realcar/).",
        *(f"Drive: {Path(drive.name).name} (sha256 {drive.sha256[:12]})" for drive in found.drives),
        *notes,
        *(f"Not determined by the drives, the vehicle's values: {each}." for each in found.untold),
    ]
    root.insert(0, ElementTree.Comment(xml_comment(heading)))
    root[0].tail = "\n  "
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def write_vehicle(found: Identification, vehicle: Vehicle, path: Path, *, tires: str) -> Path:
    """Write the MJCF of the identified car, and return its path; errors as of `vehicle_text`, and SettingsError."""
    text = vehicle_text(found, vehicle, name=path.stem, tires=tires)
    try:
        write_file(path, text.encode())
    except OSError as error:
        raise SettingsError(f"{path}: cannot be written: {error.strerror}; accepted: a file that can be") from error
    return path


def _steering(root: ElementTree.Element, found: Identification, vehicle: Vehicle) -> list[str]:
    """Write the steering's map, and give its servo lag, delay and greatest angle; return what was written."""
    told = {name: f"steering {name}" in found.told for name in ("gain", "offset", "delay")}
    gain = found.steering_gain.value if told["gain"] else 1.0
    offset = found.steering_offset.value if told["offset"] else 0.0
    element = _servo(root, "steering", "position", vehicle)
    # a servo of the kind `general` has its stiffness in its second bias
    own = element.get("biasprm", "").split()
    stiffness = -float(own[1]) if element.tag == "general" and len(own) > 1 else float(element.get("kp", "1"))
    lag, delay = found.steering_lag.value, found.steering_delay.value
    car = found.drives[0].car
    if told["delay"] and lag > _SHORTEST_LAG:
        # the servo's greatest force is its greatest rate times the damping; its lag is the damping over its stiffness
        force = max(abs(float(value)) for value in element.get("forcerange", "-1 1").split())
        stiffness = force / car.max_steering_rate / lag
    element.tag = "position"
    for name in ("gainprm", "biastype", "biasprm", "input"):
        element.attrib.pop(name, None)
    element.set("kp", f"{stiffness:.6g}")
    _put(root, "numeric", STEERING_MAP, f"{gain:.6g} {offset:.6g}")
    if told["delay"] and delay > 0.5 * _STEP:
        _delayed(element, delay)
    joint = _element(root, ".//joint[@name='steering']", vehicle)
    limit = found.steering_limit.value
    element.set("ctrlrange", f"{-limit:.6g} {limit:.6g}")
    joint.set("range", f"{-limit:.6g} {limit:.6g}")
    for name, value in _STOP.items():
        joint.set(name, value)
    return [
        f"Steering: the angle of the wheels = {found.steering_gain} times the servo's command, plus "
        f"{found.steering_offset} rad; lag {found.steering_lag} s, delay {found.steering_delay} s."
    ]


def _inertia(root: ElementTree.Element, found: Identification, vehicle: Vehicle) -> list[str]:
    """Multiply the chassis' moments of inertia, and return what was written."""
    if "inertia ratio" not in found.told:
        return []
    element = _element(root, ".//body[@name='base_link']/inertial", vehicle)
    own = [float(value) for value in element.get("diaginertia", "").split()]
    if len(own) != 3:
        raise ModelError(f"vehicle {vehicle.name!r}: its chassis has no diaginertia; accepted: one with diaginertia")
    # the wheels and axles keep theirs, so the chassis takes all of the difference
    whole = found.drives[0].car.yaw_inertia
    factor = max(1.0 + (found.inertia_ratio.value - 1.0) * whole / own[2], 0.2)
    element.set("diaginertia", " ".join(f"{factor * value:.8g}" for value in own))
    yaw_inertia = found.inertia_ratio.value * whole
    return [f"Yaw inertia: {yaw_inertia:.4g} kg m^2 of the whole car at {found.drives[0].car.mass:.4g} kg: "
            f"{found.inertia_ratio} of the vehicle's. Roll and pitch by the same factor."]  # fmt: skip


def _speed(root: ElementTree.Element, found: Identification, vehicle: Vehicle) -> list[str]:
    """Give the speed servo its gain, time constant and delay, or the wheels their drag; return what was written."""
    speed = found.speed
    if isinstance(speed, str):
        return []
    car = found.drives[0].car
    turning = 4.0 * car.wheel_inertia + DriveLine.of_spec(vehicle.spec()).motor_inertia
    effective_mass = car.mass + turning / car.wheel_radius**2
    element = _servo(root, "speed", "velocity", vehicle)
    if speed.delay[0] > 0.5 * _STEP and not speed.accelerations:
        _delayed(element, speed.delay[0])
    if speed.accelerations:
        drag = max(speed.drag[0], 0.0)
        damping = effective_mass * drag * car.wheel_radius**2 / len(WHEELS)
        for wheel in WHEELS:
            _element(root, f".//joint[@name='{wheel}_wheel']", vehicle).set("damping", f"{damping:.6g}")
        braking = speed.gain[0] if speed.braking else 0.0
        _put(root, "numeric", ACCELERATION_MAP, f"{speed.gain[0]:.6g} {braking:.6g} {speed.delay[0]:.6g}")
        return [
            f"Drive: of accelerations that were commanded it made {_said(speed.gain)}, {_said(speed.delay)} s late"
            f"{'' if speed.braking else '; of negative ones none: it coasts'}. The speed servo is the vehicle's. Drag "
            f"{_said(speed.drag)} 1/s, as damping of the wheels."
        ]
    if speed.time_constant[0] > 0.0:
        stiffness = effective_mass / speed.time_constant[0]
        element.tag = "general"
        element.attrib.pop("kv", None)
        element.set("gainprm", f"{stiffness * speed.gain[0]:.6g}")
        element.set("biastype", "affine")
        element.set("biasprm", f"0 0 {-stiffness:.6g}")
    return [f"Drive: speed = {_said(speed.gain)} of the command, time constant {_said(speed.time_constant)} s, delay "
            f"{_said(speed.delay)} s."]  # fmt: skip


def _said(value: tuple[float, float]) -> str:
    return f"{value[0]:.4g} +- {value[1]:.2g}"


def _put(root: ElementTree.Element, kind: str, name: str, data: str) -> None:
    """Write a custom element, in place of one of that name."""
    custom = root.find("custom")
    if custom is None:
        custom = ElementTree.SubElement(root, "custom")
    for element in custom.findall(f"{kind}[@name='{name}']"):
        custom.remove(element)
    ElementTree.SubElement(custom, kind, {"name": name, "data": data}).tail = "\n  "


def _delayed(element: ElementTree.Element, delay: float) -> None:
    element.set("delay", f"{delay:.4g}")
    element.set("nsample", str(_SAMPLES))


def _servo(root: ElementTree.Element, name: str, kind: str, vehicle: Vehicle) -> ElementTree.Element:
    """Return an actuator of its usual kind, or a `general` one, as this module writes it."""
    general = root.find(f"actuator/general[@name='{name}']")
    return _element(root, f"actuator/{kind}[@name='{name}']", vehicle) if general is None else general


def _element(root: ElementTree.Element, place: str, vehicle: Vehicle) -> ElementTree.Element:
    element = root.find(place)
    if element is None:
        raise ModelError(
            f"vehicle {vehicle.name!r}: its MJCF has no {place.removeprefix('.//')}; accepted: a vehicle built as "
            "models/f1tenth.xml, whose identified copy can be written"
        )
    return element
