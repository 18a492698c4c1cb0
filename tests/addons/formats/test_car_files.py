"""Cars of the files that teams have: what they tell is built in, what they do not tell is said, and each laps."""

import json
import math

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.formats import cars
from fg_mujoco.addons.formats.cars import car_of
from fg_mujoco.addons.gym2d.params import own_params
from fg_mujoco.cli.main import main
from fg_mujoco.errors import Note, SettingsError
from fg_mujoco.vehicle.vehicle import Vehicle

GYM = {
    "mu": 0.8, "C_Sf": 5.2, "C_Sr": 6.1, "lf": 0.16, "lr": 0.17, "h": 0.07, "m": 3.9, "I": 0.05, "s_min": -0.36,
    "s_max": 0.36, "sv_min": -3.0, "sv_max": 3.0, "v_switch": 7.319, "a_max": 9.51, "v_min": -5.0, "v_max": 15.0,
}  # fmt: skip
VESC = {
    "speed_to_erpm_gain": 4000.0, "speed_to_erpm_offset": 0.0, "steering_angle_to_servo_gain": -1.2,
    "steering_angle_to_servo_offset": 0.53, "wheelbase": 0.32,
    "vesc_driver": {"servo_min": 0.15, "servo_max": 0.85, "speed_min": -24000, "speed_max": 24000},
}  # fmt: skip
FORZA = {
    "C_Pf": [4.8, 2.16, 0.65, 0.37], "C_Pr": [20.0, 1.5, 0.62, 0.0], "C_acc": 0.36, "I_z": 0.058, "a_max": 3,
    "a_min": -3, "h_cg": 0.014, "l_f": 0.162, "l_r": 0.145, "l_wb": 0.307, "m": 3.54, "mu": 1, "model_name": "NUC2",
}  # fmt: skip
SLIPX = {
    "dynamics.yaml": {"mass": 3.5, "inertia": {"ixx": 0.025, "izz": 0.05}, "resistance": {"roll_resist": 0.015},
                      "geometry": {"lf": 0.16, "lr": 0.16, "h_cog": 0.06, "wheel_radius": 0.05, "width": 0.3}},
    "limits.yaml": {"steering": {"max_angle": 0.4, "max_rate": 10.0}, "drivetrain": {"accel_max": 8.0, "v_max": 20.0}},
    "tyres/sponge.yaml": {"nominal_load": 8.6, "linear": {"c_alpha": 60.0}, "friction": {"mu_y0": 1.1, "k_mu": 0.15},
                          "mf_lite": {"C": 1.68, "E": 0.42}, "relaxation": {"sigma": 0.05}},
}  # fmt: skip
SLIP = {"c_alpha": 40, "nominal_load": 8, "mu_y0": 0.9, "C": 1.5, "mass": 3}  # of SlipX's tyres
LINK = (
    '<link name="{}"><inertial><mass value="{}"/><origin xyz="{}"/><inertia ixx=".01" iyy=".03" izz="{}"/></inertial>'
    "<collision><geometry><{}/></geometry></collision></link>"
)
SPIN = (
    '<joint name="j{0}" type="continuous"><parent link="base"/><child link="{0}"/><origin xyz="{1}" rpy="1.57 0 0"/>'
    "</joint>"
)
URDF = "<robot name='r'>{}</robot>".format("".join([
    LINK.format("base", 3.2, "0.15 0 0.02", 0.04, 'box size="0.5 0.28 0.1"'),
    *(LINK.format(f"{x}{y}", 0.1, "0 0 0", 0.0001, 'cylinder radius="0.05"') for x in (0, 32) for y in "lr"),
    *(SPIN.format(f"{x}{y}", f"{x / 100} {0.1 if y == 'l' else -0.1} 0") for x in (0, 32) for y in "lr"),
]))  # fmt: skip
TUM = """# global_racetrajectory_optimization
[GENERAL_OPTIONS]
ggv_file="ggv.csv"
veh_params = {"v_max": 12.0, "length": 0.535, "width": 0.30,
              "mass": 3.518, "dragcoeff": 0.0136, "curvlim": 1.0, "g": 9.81}
vel_calc_opts = {"dyn_model_exp": 1.0, "vel_profile_conv_filt_window": null}

[OPTIMIZATION_OPTIONS]
# mue: [-] constant friction coefficient
optim_opts_mintime={"width_opt": 0.7, "mue": 0.8, "limit_energy": false}
vehicle_params_mintime = {"wheelbase_front": 0.159, "wheelbase_rear": 0.171, "cog_z": 0.06, "I_z": 0.05,
                          "delta_max": 0.34, "power_max": 200.0, "f_drive_max": 28.0}
tire_params_mintime = {"c_roll": 0.02, "f_z0": 9.0, "B_front": 7.4, "C_front": 1.5, "eps_front": -0.1, "E_front": 0.85,
                       "B_rear": 7.8, "C_rear": 1.6, "eps_rear": -0.05, "E_rear": 0.9}
"""
FILES = {
    "racecar.ini": TUM,
    "params.yaml": GYM,
    "vesc.yaml": {"/**": {"ros__parameters": VESC}},
    "NUC2": {"NUC2_pacejka.yaml": FORZA, "vesc.yaml": VESC},
    "slipx": SLIPX,
    "car.urdf": URDF,
}
BUILT = {
    "racecar.ini": {"m": 3.518, "lf": 0.159, "lr": 0.171, "h": 0.06, "I": 0.05, "s_max": 0.34, "v_max": 12.0,
                    "a_max": 28.0 / 3.518, "v_switch": 200.0 / 28.0, "length": 0.535, "width": 0.3},
    "params.yaml": {name: value for name, value in GYM.items() if not name.startswith(("C_", "mu"))},
    "vesc.yaml": {"s_max": 0.32 / 1.2, "v_max": 6.0, "m": 3.74},
    "NUC2": {"m": 3.54, "lf": 0.162, "lr": 0.145, "I": 0.058, "h": 0.014, "v_max": 6.0, "a_max": 3.0},
    "slipx": {"m": 3.5, "lf": 0.16, "lr": 0.16, "I": 0.05, "h": 0.06, "s_max": 0.4, "width": 0.3},
    "car.urdf": {"m": 3.6, "lr": (3.2 * 0.15 + 0.2 * 0.32) / 3.6, "length": 0.5, "width": 0.28},
}
SAID = {
    "racecar.ini": ["mass 3.518 kg: mass of racecar.ini", "greatest acceleration 7.959 m/s^2: f_drive_max and mass",
                    "D of the rear tires times 0.952", "not used: dragcoeff, curvlim, g, dyn_model_exp, width_opt"],
    "params.yaml": ["width 0.31 m: not given, f1tenth's", "brush tires of C_Sf, C_Sr and mu of params.yaml"],
    "vesc.yaml": ["mass 3.74 kg: not given", "greatest speed 6 m/s: speed_max and the gain", "mu 1.0489: not given"],
    "NUC2": ["wheelbase 0.32 of vesc.yaml is not used", "not used: C_acc, a_min", "force behind the peak"],
    "slipx": ["wheel_radius 0.05 of dynamics.yaml is not used", "Magic Formulas of sponge.yaml"],
    "car.urdf": ["mass 3.6 kg: the links", "greatest steering angle 0.4189 rad: not given, f1tenth's"],
}
TIRES = {"racecar.ini": "magic_formula", "params.yaml": "brush", "vesc.yaml": "magic_formula",
         "NUC2": "magic_formula", "slipx": "magic_formula", "car.urdf": "magic_formula"}  # fmt: skip


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(folder, name, content):
    if not isinstance(content, str) and any("." in key for key in content):
        for file, each_one in content.items():
            write(folder / name, file, each_one)
        return
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content))


@each("name", FILES)
def test_a_car_of_any_stack_is_built_said_and_driven(folder, name):
    write(folder, name, FILES[name])
    with pytest.warns(Note, match="told are"):
        vehicle = Vehicle.load(name)
    own = own_params(vehicle)
    for quantity, value in BUILT[name].items():
        assert own[quantity] == pytest.approx(value, rel=0.01), quantity
    words = "\n".join(car_of([folder / name]).words)
    assert all(said in words for said in SAID[name])
    assert vehicle.tires.model == TIRES[name]
    assert fg.race("oval", "gap_finder", vehicle=vehicle, laps=1, max_speed=5.0).car.finished


def test_tires_are_those_that_are_told(folder):
    for name in ("params.yaml", "NUC2", "slipx"):
        write(folder, name, FILES[name])
    brush = Vehicle.load("params.yaml").tires.front.lateral
    assert (brush.stiffness, brush.D) == (5.2, 0.8)
    formula = Vehicle.load("NUC2").tires.rear.lateral
    assert (formula.B, formula.C, formula.D, formula.E) == (20.0, 1.5, 0.62, 0.0)
    tire = Vehicle.load("slipx").tires.front
    assert tire.lateral.slope == pytest.approx(60.0 / 8.6) and tire.load_sensitivity == 0.15
    assert (tire.relaxation_length, tire.rolling_resistance) == (0.05, 0.015)
    write(folder, "racecar.ini", TUM)
    tire = Vehicle.load("racecar.ini").tires.front
    for load in (0.9 * tire.nominal_load, 1.1 * tire.nominal_load):  # as TUM's D = mue F_z (1 + eps F_z / f_z0)
        found = tire.lateral.D * (load / tire.nominal_load) ** -tire.load_sensitivity
        assert found == pytest.approx(0.8 * (1.0 - 0.1 * load / 9.0), rel=1e-3)
    assert (tire.lateral.B, tire.lateral.E, tire.rolling_resistance) == (7.4, 0.85, 0.02)
    for names in (("C_Pf", "C_Pr"), ("pacejka_front", "pacejka_rear")):
        write(folder, "list.txt", json.dumps({name: [5.0, 1.5, 0.7, 0.3] for name in names}))
        assert Vehicle.load("list.txt").tires.rear.lateral.D == 0.7
    flat = {"Bf": 5.54, "Cf": 0.42, "Df": 1.86, "Ef": 0.37, "Br": 6.6, "Cr": 0.56, "Dr": 1.73, "Er": 1.06, "m": 3.5}
    write(folder, "flat.yaml", flat)  # without a peak, as a car has it that never slid
    brush = Vehicle.load("flat.yaml").tires.front.lateral
    assert (brush.model, brush.slope) == ("brush", pytest.approx(5.54 * 0.42 * 1.86)) and 0.9 < brush.D < 1.1
    write(folder, "narrow.yaml", {"width": 0.2032, "m": 3.47, "lf": 0.159, "lr": 0.171})  # as ForzaETH's simulator
    assert Vehicle.load("narrow.yaml").parameters.width == pytest.approx(0.2032)
    three = {"B_f": -9.0, "C_f": 1.4, "D_f": 0.8, "B_r": -9.0, "C_r": 1.4, "D_r": 0.9}  # as in models of MPC
    write(folder, "three.json", {"mass": 3.5, **three})
    formula = Vehicle.load("three.json").tires.front.lateral
    assert (formula.B, formula.C, formula.D, formula.E) == (9.0, 1.4, 0.8, 0.0)
    write(folder, "own.yaml", GYM | {"C_Sf": 4.718, "C_Sr": 5.4562})  # which every file has
    assert Vehicle.load("own.yaml").tires == Vehicle.load().tires and Vehicle.load("own.yaml").greatest_mu() == 0.8


def test_what_is_not_this_car_s_is_said_and_not_used(folder):
    """The wheelbase of every vesc.yaml, the length of a car drawn as a point, a cornering stiffness in some unit."""
    other = {"manager": {"ros__parameters": {"speed_max": 5.0}}}  # in another unit, of another node
    write(folder, "a.json", VESC | {"wheelbase": 0.25, "length": 0.32, "Cf": 2.3} | other)
    words, own = "\n".join(car_of([folder / "a.json"]).words), own_params(Vehicle.load("a.json"))
    assert own["lf"] + own["lr"] == pytest.approx(0.3302) and own["length"] == pytest.approx(0.58)
    assert "the wheelbase of 0.25 m that every vesc.yaml has" in words
    assert "a second speed_max of 5" in words and own["v_max"] == pytest.approx(6.0)
    assert "length 0.32 of a.json is not used: the axles are 0.33 m apart" in words
    assert "Cf 2.3 is not used: B and D are not given" in words


def test_the_command_writes_a_vehicle_that_drives_alike_and_a_page(folder, capsys):
    write(folder, "NUC2", FILES["NUC2"])
    assert main(["car", "NUC2", "--out", "mine"]) == 0
    assert "greatest steering rate 3.2 rad/s: not given" in capsys.readouterr().out
    laps = [fg.race("oval", "gap_finder", vehicle=each, laps=1).car.lap_times_s for each in ("NUC2", "mine/NUC2.xml")]
    assert laps[0] == laps[1]
    page = (folder / "mine/NUC2.html").read_text()
    assert "f1tenth" in page and "wheelbase 0.32 of vesc.yaml" in page
    assert main(["car", "NUC2", "--out", "mine"]) == 2


ODD = ["a--->", "a--", "x\nrelaxation_length = 9", "x\n[front]\nD = 9.0", "x\x01y", "x\x1b[31mred\x07", "<script>a<"]


@each("name", ODD)
def test_a_name_of_any_characters_is_text_in_what_is_written(folder, name, capsys):
    write(folder, "plain.yaml", GYM)
    write(folder, 'odd"\n.yaml', json.dumps(GYM | {name: 1}))
    assert main(["car", "plain.yaml", "--out", "mine"]) == main(["car", 'odd"\n.yaml', "--out", "mine"]) == 0
    assert "\x1b" not in capsys.readouterr().out
    plain, odd = (Vehicle.load(f"mine/{each}.xml") for each in ("plain", "odd_"))
    assert odd.tires.axles == plain.tires.axles and odd.parameters == plain.parameters
    assert "<script>" not in (folder / "mine/odd_.html").read_text()


def test_a_car_that_cannot_be_loaded_leaves_what_was_there(folder, monkeypatch, capsys):
    write(folder, "car.yaml", GYM)
    assert main(["car", "car.yaml", "--out", "mine"]) == 0
    before = {path.name: path.read_bytes() for path in (folder / "mine").iterdir()}
    monkeypatch.setattr(cars, "xml_comment", lambda lines: "--><oops>")
    assert main(["car", "car.yaml", "--out", "mine", "--force"]) == 2
    assert main(["car", "car.yaml", "--out", "other"]) == 2 and not (folder / "other").exists()
    assert {path.name: path.read_bytes() for path in (folder / "mine").iterdir()} == before
    assert ".partial" not in capsys.readouterr().err


@each(
    ("name", "content", "message"),
    [
        ("a.yaml", {"s_max": 24.0}, "s_max is 24: degrees.; accepted: 0.01 to 1.2 rad"),
        ("a.yaml", {"m": 3.7, "mass": 3.9}, "m is 3.7 and mass is 3.9; accepted: one of them"),
        ("a.yaml", {"m": math.nan}, "m is nan; accepted: 0.1 to 5000 kg"),
        ("a.yaml", {"m": 3740.0}, "no such car can be built: m is 3740 kg"),
        ("a.yaml", {"rate": 3}, "tells nothing of a car; accepted: names as m, lf"),
        ("a.yaml", {"m": 3.7, "Bf": 5.0, "mu": 1.0}, "the Magic Formulas lack Cf, Df"),
        ("a.yaml", {"m": 3.7, "mu": 0.9, "I": 0.0002}, "no such car can be built"),
        ("a.yaml", "m: [", "a.yaml: "),
        ("a.yaml", "m: 3\nm: 4", "line 2: the key 'm' is given twice"),
        ("a.yaml", {"m": int("9" * 400)}, "m is inf; accepted: 0.1 to 5000 kg"),
        ("a.yaml", SLIP | {"mu_y0": 0}, "mu_y0 is 0; accepted: a number above 0"),
        ("a.yaml", SLIP | {"C": 0}, "C is 0; accepted: a number above 0"),
        ("a.yaml", {f"{name}_{axle}": value for axle in "fr" for name, value in zip("BCD", (5, 0, 1), strict=True)},
         "Magic Formula of B 5, C 0, D 1, E 0 has no force"),
        ("a.urdf", "<robot><link name='a'><inertial><mass value='0'/></inertial></link></robot>", "masses of its"),
        ("a.urdf", "<robot><link name='a'><inertial><mass value='1e308'/></inertial></link></robot>", "no car has"),
        ("a.urdf", "<robot><link name='a'/></robot>", "no link has a mass"),
        ("a.xacro", "<robot xmlns:xacro='x'><xacro:if/></robot>", "the URDF that `xacro a.xacro > car.urdf` writes"),
        ("a.yaml", {"m": 3.7, "Bf": 9.0, "Cf": 1.4, "Df": 18.0}, "Df is 18; accepted: 0.001 to 3 times the load"),
        ("a.ini", TUM.replace("3.518", "1200").replace("9.0", "3000"), "no such car can be built: m is 1200 kg"),
        ("a.ini", TUM.replace('eps_front": -0.1', 'eps_front": -0.9'), "eps_front -0.9 with f_z0 9 N changes the fric"),
        ("a.ini", TUM.replace('f_z0": 9.0', 'f_z0": 0'), "f_z0 is 0; accepted: 0.001 to 1e.06 N"),
        ("a.ini", "m = 3", "a.ini: File contains no section headers"),
        ("a.ini", "[a]\nx = {'m': 3, 'm': 4}", "the key 'm' is given twice"),
        ("b", {"other.yaml": {"m": 3}}, "is a folder without a file of a car; accepted: an MJCF"),
    ],
)  # fmt: skip
def test_what_cannot_be_a_car_is_refused_in_a_line(folder, name, content, message):
    write(folder, name, content)
    with pytest.raises(SettingsError, match=message) as refusal:
        Vehicle.load(name)
    assert "\n" not in str(refusal.value)
