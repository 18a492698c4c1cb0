"""A file that is not that of a vehicle is refused in one line: which name, in which file, and what is accepted."""

import re
import warnings

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.simulation.cars import WorldCar
from fg_mujoco.vehicle.contract import NEEDED
from vehicle_worlds import F1TENTH, made_file


def edited(*changes):
    """Return the text of models/f1tenth.xml with some parts of it replaced, each of which must be there."""
    text = F1TENTH
    for before, after in changes:
        assert before in text, before
        text = text.replace(before, after)
    return text


def refusal(folder, text, kind=fg.ModelError):
    """Return the one line by which a vehicle file of this text is refused."""
    path = folder / "mine.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(kind) as refused:
        fg.World("oval", str(path))
    line = str(refused.value)
    assert "\n" not in line and str(path) in line and "accepted: " in line
    return line


def test_all_faults_are_told_at_once(tmp_path):
    missing = edited(('name="chassis_contact"', 'name="touch"'), ('<site name="lidar_mount"', '<site name="mount"'))
    line = refusal(tmp_path, missing)
    assert "no site named 'lidar_mount'" in line and "no sensor named 'chassis_contact'" in line
    spec = fg.Vehicle.load().spec()
    spec.geom("ground").pos[2] = -0.01
    spec.geom("nose").pos[2] = spec.site("lidar_mount").pos[2]
    line = refusal(tmp_path, spec.to_xml())
    for fault in ("'ground' is at z = -0.01", "front_left_tire is", "rear_right_tire is", "geom 'nose' is in the way"):
        assert fault in line


@each(
    ("name", "text", "said"),
    [
        ("mine.xml", '<?xml version="1.0"?>\n<robot name="small"/>', "is a URDF or SDF"),
        ("mine.stl", "solid", "is a mesh"),
        ("mine.xml", "<mujoco><include file='car.xml'/></mujoco>", "<include> is not .*is the MJCF of something else"),
        ("mine.xml", "<mujoco><worldbody><geom name='ground' type='plane' size='1 1 1'/></worldbody></mujoco>",
         r"is the MJCF of something else: it has 1 of the \d\d names of a vehicle; accepted: .*own_car"),
    ],
)  # fmt: skip
def test_a_file_of_another_kind_is_named_as_what_it_is(tmp_path, monkeypatch, name, text, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_text(text)
    for path in (name, str(tmp_path / name)):
        with pytest.raises(fg.ModelError, match=said):
            fg.Vehicle.load(path)


@each(("rise", "alpha", "is_met"), [(0.0, 1.0, True), (0.0, 0.0, False), (-0.04, 1.0, False)])
def test_a_part_in_the_beams_of_the_lidar_is_refused(tmp_path, rise, alpha, is_met):
    """`rangefinder` sees it, and `raycast` does not."""
    spec = fg.Vehicle.load().spec()
    mount = spec.site("lidar_mount").pos
    base = spec.body("base_link")
    base.add_geom(
        name="mast", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=(0.004, 0.02, 0.0), mass=0.0, contype=0, conaffinity=0,
        pos=(mount[0] + 0.1, mount[1], mount[2] + rise), rgba=(0.1, 0.1, 0.1, alpha),
    )  # fmt: skip
    path = tmp_path / "mine.xml"
    path.write_text(spec.to_xml())
    if is_met:
        with pytest.raises(
            fg.ModelError, match=r"geom 'mast' is in the way of \d+ of the 1081 beams .*, 0\.096 m from"
        ):
            fg.Vehicle.load(path)
    else:
        fg.Vehicle.load(path)


def test_a_world_that_mujoco_writes_and_does_not_read_is_refused_in_a_line(tmp_path):
    path = tmp_path / "mine.xml"
    path.write_text(edited(("</sensor>", '<user dim="3" needstage="vel"/></sensor>')), encoding="utf-8")
    with pytest.raises(fg.ModelError, match=r"^MuJoCo does not read the world that it wrote: .* 'user'.*; accepted: "):
        fg.World("oval", path)


def test_a_world_has_the_memory_that_it_needs_whatever_the_car_alone_does_with(tmp_path):
    path = tmp_path / "mine.xml"
    path.write_text(edited(('memory="2M"', 'memory="20K"')), encoding="utf-8")
    assert fg.World("oval", str(path)).model.narena == fg.World("oval").model.narena


@each(
    ("own", "material", "is_seen"),
    [("1 0 0 0", "1 1 1 1", False), ("1 0 0 1", "1 1 1 0", True), ("1 0 0 .3", "1 1 1 1", True), ("", "1 1 1 1", True),
     ("", "1 1 1 0", False), (".5 .5 .5 0", "1 1 1 1", False), (".5 .5 .5 1", "1 1 1 0", False)],
)  # fmt: skip
def test_beams_see_a_part_of_another_car_where_pictures_draw_it(tmp_path, own, material, is_seen):
    mast = f'<geom name="mast" class="visual" type="box" size=".01 .01 .1" pos=".4 0 .3" material="m" rgba="{own}"/>'
    nose, assets = '<geom name="nose"', f'<asset><material name="m" rgba="{material}"/>'
    text = edited(("<asset>", assets), (nose, mast.replace(' rgba=""', "") + nose))
    (tmp_path / "mine.xml").write_text(text, encoding="utf-8")
    model = fg.World("oval", others=(WorldCar(vehicle=tmp_path / "mine.xml"),)).model
    data, part, met = mujoco.MjData(model), model.geom("car_1/mast").id, np.zeros(1, np.int32)
    mujoco.mj_forward(model, data)
    mujoco.mj_ray(model, data, data.geom_xpos[part] + (0.0, 0.0, 1.0), np.array((0.0, 0.0, -1.0)), None, 1, -1, met)
    scene = mujoco.MjvScene(model, 1000)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL, scene)
    drawn = [geom.rgba[3] > 0.0 for geom in scene.geoms[: scene.ngeom] if geom.objid == part and geom.objtype == 5]
    assert (met[0] == part, any(drawn)) == (is_seen, is_seen)


KINDS = {"numeric": "numeric", "tendon": "fixed", "pair": "pair"}


@each("part", NEEDED, ids=lambda part: f"{part.kind} {part.name}")
def test_a_part_that_is_missing_is_named(tmp_path, part):
    """By another name, it is not there: everything that refers to it takes the new one."""
    spec = fg.Vehicle.load().spec()
    element = getattr(spec, part.kind)(part.name)
    element.name = "renamed"
    text = fg.Vehicle.load().text
    # in the text, because a spec refers to what has been renamed by its old name
    tag = {"actuator": r"(?:position|velocity)", "sensor": r"\w+", "joint": r"(?:joint|freejoint)"}
    opening = rf'(<{tag.get(part.kind, KINDS.get(part.kind, part.kind))} name=")({part.name})(")'
    found = list(re.finditer(opening, text))
    if part.kind == "joint":  # an equality of a joint has the tag, too
        found = found[:1]
    if part.kind == "sensor":
        found = found[-1:]
    (place,) = found
    text = text[: place.start(2)] + "renamed" + text[place.end(2) :]
    references = {
        "geom": r'geom[12]?="{}"', "site": r'site="{}"', "tendon": r'tendon="{}"', "body": r'objname="{}"',
        "joint": r'joint[12]?="{}"',
    }  # fmt: skip
    if part.kind in references:
        text = re.sub(
            references[part.kind].format(part.name), lambda m: m[0].replace(f'"{part.name}"', '"renamed"'), text
        )
    line = refusal(tmp_path, text)
    assert f"has no {part.kind} named {part.name!r}" in line and part.what in line


@each(
    ("before", "after", "named"),
    [
        ('<body name="rear_right_wheel">', '<body name="rear_left_wheel">', "body 'rear_left_wheel' is there twice"),
        ('<joint name="rear_right_wheel"', '<joint name="rear_left_wheel"', "joint 'rear_left_wheel' is there twice"),
        ('<pair name="rear_right_tire"', '<pair name="rear_left_tire"', "pair 'rear_left_tire' is there twice"),
        ('<site name="imu"', '<site name="lidar_mount"', "site 'lidar_mount' is there twice"),
        ('<velocity name="speed"', '<velocity name="steering"', "actuator 'steering' is there twice"),
        ('name="gyro"', 'name="accelerometer"', "sensor 'accelerometer' is there twice"),
    ],
)
def test_a_name_that_is_there_twice_is_named_with_its_line(tmp_path, before, after, named):
    line = refusal(tmp_path, edited((before, after)))
    assert re.search(rf"{re.escape(named)} \(line \d+\); accepted: each name once", line)


@each(
    ("changes", "named"),
    [
        ([('mass="3.12"', 'mass="0"')], "mass or inertia of body 'base_link' is not positive"),
        ([('mass="3.12"', 'mass="nan"')], "<inertial mass> has nan; accepted: numbers up to 1e99"),
        ([('mass="3.12"', 'mass="heavy"')], "bad format in attribute 'mass'"),
        ([('data="7.319"', 'data="-1"')], "power_limit_speed is -1.0; accepted: a positive number"),
        ([('name="base_link" pos="0 0 0.0486', 'name="base_link" pos="0 0 0.06')], "front_left_tire is 11.4 mm over"),
        ([('name="base_link" pos="0 0 0.0486', 'name="base_link" pos="0 0 0.04')], "front_left_tire is 8.64 mm in"),
        ([('name="rear_left_carrier" pos="0 0.118 0"', 'name="rear_left_carrier" pos="0 0.118 0.02"')],
         "rear_left_tire is 19.2 mm over the ground at rest"),
        ([('name="rear_left_carrier" pos="0 0.118 0"', 'name="rear_left_carrier" pos="0 0.118 -0.0486075"')],
         "rear_left_wheel roll on 0.049 m, its middle at 0 m"),
        ([('springref="-0.0040268"', 'springref="0.03"')], "the chassis moves by"),
        ([('stiffness="2000"', 'stiffness="0"'), ('range="-0.010 0.010"', 'range="-0.2 0.2"')], "the chassis moves by"),
        ([("0.01225", "0.0245")], "tendon 'drive' makes front_left_wheel roll on 0.098 m"),
        ([('<joint joint="rear_left_wheel" coef="0.01225"/>', "")], "0 of rear_left_wheel, 0.01225 of rear_right"),
        ([("0.01225", "0")], "tendon 'drive' has the spin of no wheel; accepted: the spins of both wheels"),
        ([('name="centre" data="shaft"', 'name="centre" data="viscous"')], "'viscous'; accepted: 'open' or 'shaft'"),
        ([(f'<joint joint="front_{side}_wheel" coef="0.01225"/>', "") for side in ("left", "right")],
         "text 'centre' is 'shaft' and tendon 'drive' drives one axle; accepted: 'open', or a tendon of all four"),
        ([('"rear_axle" data="open"', '"rear_axle" data="limited -1 0"')], "'limited -1 0'; accepted: 'open'"),
        ([('"rear_axle" data="open"', '"rear_axle" data="limited nan 1"')], "'limited nan 1'; accepted: 'open'"),
        ([('"rear_axle" data="open"', '"rear_axle" data="limited 0 0"')], "'limited 0 0'; accepted: 'open'"),
        ([('"front_axle" data="open"', '"front_axle" data="Locked"')], "'Locked'; accepted: 'open'"),
        ([('name="centre" data="shaft"', 'name="center" data="shaft"')],
         "text 'center' is nothing that is read; accepted: 'centre'"),
        ([('<text name="rear_axle" data="open"/>', '<numeric name="rear_axle" data="1"/>')],
         "numeric 'rear_axle' is read as a text; accepted: such a one"),
        ([('"motor_inertia" data="0.0003"', '"motor_inertia" data="-1"')], "'motor_inertia' is -1; accepted: a number"),
        ([("</equality>", '<joint joint1="rear_left_wheel" joint2="rear_right_wheel" name="spool"/></equality>')],
         "equality 'spool' ties spins of wheels, between whose answers tires act many times; accepted: a text"),
        ([('"front_left_carrier" pos="0.3302 0.118 0"', '"front_left_carrier" pos="0.3302 -0.118 0"'),
          ('"front_right_carrier" pos="0.3302 -0.118 0"', '"front_right_carrier" pos="0.3302 0.118 0"')],
         "front_left_wheel is at y = -0.118 m and front_right_wheel at 0.118 m; accepted: y grows to the left"),
        ([('"rear_left_carrier" pos="0 0.118 0"', '"rear_left_carrier" pos="0 -0.118 0"'),
          ('"rear_right_carrier" pos="0 -0.118 0"', '"rear_right_carrier" pos="0 0.118 0"')],
         "rear_left_wheel is at y = -0.118 m"),
        ([('_carrier" pos="0.3302 ', '_carrier" pos="-0.3302 ')],
         "front_left_wheel is at x = -0.3302 m and rear_left_wheel at 0 m; accepted: x grows forward"),
        ([('<geom name="ground" type="plane" size="0 0 0.1"', '<geom name="ground" type="box" size="9 9 0.1"')],
         "geom 'ground' is a box; accepted: a plane"),
        ([('<geom name="ground" type="plane"', '<geom name="ground" pos="0 0 -1" type="plane"')],
         "geom 'ground' is at z = -1 m; accepted: at 0"),
        ([('name="steering" type="hinge"', 'name="steering" type="slide"')], "joint 'steering' is a slide"),
        ([('<framepos name="rear_left_wheel_position"', '<framepos name="other" objtype="xbody" objname="base_link"/>'
           '<framepos name="rear_left_wheel_position"')], "the tires' sensors are apart"),
        ([("</worldbody>", "</worldbdy>")], "no XML: mismatched tag"),
        ([("integrator=", "integrater=")], "did you mean 'integrator'?"),
        ([('data="hokuyo_ust10lx.xml"', 'data="velodyne.xml"')],
         "text 'lidar' names 'velodyne.xml'; accepted: a file in its folder, or a bundled one"),
        ([('data="f1tenth_look.xml"', 'data="nowhere.xml"')], "text 'look' names 'nowhere.xml'"),
        ([('<position name="steering"', '<pid name="steering"')], "actuator 'steering' has 2 inputs; accepted: "),
        ([('<position name="steering" joint="steering" kp="50"', '<intvelocity name="steering" joint="steering" '
           'kp="50" actrange="-1 1"')], "actuator 'steering' has dyntype integrator; accepted: none, filter,"),
        ([("<actuator>", '<actuator><dcmotor name="drag" joint="rear_left_wheel" motorconst=".001" resistance="1" '
           'input="none"/>')], "its actuators are drag, steering, speed; accepted: steering, speed"),
        ([('integrator="implicitfast"', 'integrator="discrete"')], "option integrator is discrete; accepted: implicit"),
        ([('<flag island="disable"/>', '<flag damper="disable"/>')], "option disables flag damper"),
        ([('<joint joint="front_left_wheel" coef="0.01225"/>', "")], "'drive' has 0 of front_left_wheel, 0.01225 of"),
        ([("<tendon>", '<tendon><fixed name="centre" damping="200"><joint joint="front_left_wheel" coef="0.0245"/>'
           '<joint joint="rear_left_wheel" coef="-0.0245"/></fixed>')], "tendon 'centre' damps its joints at 141"),
        ([('condim="3" friction="1.0489 1.0489', 'condim="3" margin="0.002" friction="1.0489 1.0489')],
         "pair 'front_left_tire' has margin 0.002; accepted: 0, or MuJoCo's own tires"),
        ([('condim="3" friction="1.0489 1.0489', 'condim="3" adhesion="9" friction="1.0489 1.0489')],
         "pair 'front_left_tire' has adhesion 9"),
        ([('condim="3" friction="1.0489 1.0489', 'condim="4" friction="1.0489 1.0489')], "has condim 4 and friction"),
        ([('condim="3" friction="1.0489 1.0489', 'condim="3" friction="1.0489 0.5')], "friction 1.0489 0.5; accepted:"),
        ([('geom1="rear_left_tire" geom2', 'friction="0.6 0.6 0 0 0" geom1="rear_left_tire" geom2')],
         "the rear tires have friction 0.6 and 1.0489; accepted: one of both"),
        ([('<geom name="rear_left_tire" class="tire"', '<geom name="rear_left_tire" pos="0 0.02 0" class="tire"')],
         "geom 'rear_left_tire' is 0.02 m from its body's origin"),
        ([('axis="0 1 0"', 'axis="0 1 0" range="-2 2"')], "joint 'front_left_wheel' has a range; accepted: none"),
        ([('type="ellipsoid" size="0.0493925 0.020 0.0493925"', 'type="box" size="0.0493925 0.020 0.0493925"')],
         "geom 'front_left_tire' is not round about the axle of its wheel; accepted: a sphere"),
        ([('size="0.0493925 0.020 0.0493925"', 'size="0.020 0.0493925 0.0493925"')], "tire' is not round about"),
        ([("</worldbody>", '<body name="ghost" mocap="true"/></worldbody>')], "body 'ghost' is a mocap body"),
        ([('<joint name="ackermann_left"', '<joint active="false" name="ackermann_left"')], "kingpins is not active"),
        ([('axis="0 0 1" damping="0.023"', 'axis="0 0 -1" damping="0.023"')], "rad/s when it is steered to the left;"),
        ([('axis="0 1 0"', 'axis="0 -1 0"')], "m/s after 1 s at a command of 1 m/s; accepted: a drive that moves it"),
    ],
)  # fmt: skip
def test_what_cannot_be_driven_is_refused(tmp_path, changes, named):
    assert named in refusal(tmp_path, edited(*changes))


@each(
    ("lidar", "named"),
    [
        (b"\xff\xfe", "it is not UTF-8 text"),
        (b"<mujoco", "XML"),
        (b"<mujoco/>", "has 0 bodies in the world and no frame 'beams'"),
        (b'<mujoco><worldbody><body name="a"><frame name="beams"/></body></worldbody></mujoco>', "has 0 sensors"),
    ],
)
def test_a_lidar_that_is_none_is_refused_by_its_file(tmp_path, lidar, named):
    (tmp_path / "eye.xml").write_bytes(lidar)
    path = tmp_path / "mine.xml"
    path.write_text(edited(('data="hokuyo_ust10lx.xml"', 'data="eye.xml"')), encoding="utf-8")
    with pytest.raises(fg.ModelError) as refused:
        fg.Vehicle.load(path)
    line = str(refused.value)
    assert "\n" not in line and f"LiDAR file {tmp_path / 'eye.xml'}" in line and named in line and "accepted: " in line


def test_a_file_that_cannot_be_read_is_refused(tmp_path):
    for path, reason in ((tmp_path / "none.xml", "No such file"), (tmp_path, "is a folder")):
        with pytest.raises(
            fg.SettingsError, match=rf"^vehicle file {re.escape(str(path))}: {reason}.*; accepted: an MJCF"
        ):
            fg.Vehicle.load(path)
    (tmp_path / "bytes.xml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(fg.SettingsError, match="it is not UTF-8 text"):
        fg.Vehicle.load(str(tmp_path / "bytes.xml"))


def test_a_wheelbase_that_the_steering_does_not_follow_is_warned_of_once(tmp_path):
    (tmp_path / "long.xml").write_text(edited(("0.3302", "0.40")), encoding="utf-8")
    with pytest.warns(
        UserWarning, match=r"long.xml: front_left_kingpin is at 0\.487. rad .* 0\.473.: tires slide"
    ) as said:
        fg.Vehicle.load(tmp_path / "long.xml")
    assert len(said) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fg.Vehicle.load(tmp_path / "long.xml")
        fg.Vehicle.load(made_file())
