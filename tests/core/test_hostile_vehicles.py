"""Vehicle files that somebody made to harm: each is refused in one line, and no file but the vehicle's own is read."""

import re
import struct
import zlib

import mujoco
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course import mjcf
from fg_mujoco.course.mjcf import MOST_BODIES, MOST_ELEMENTS, checked_mjcf
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.pictures.rendering.scenery import compile_scenery
from refusals import refused
from vehicle_worlds import F1TENTH


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a vehicle's, in which files are that belong to nobody else, and one beside it that is private."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "private").mkdir()
    (tmp_path / "car").mkdir()
    return tmp_path


def added(text):
    return lambda xml: xml.replace("</mujoco>", text + "</mujoco>")


def swapped(*pairs):
    def change(xml):
        for before, after in pairs:
            assert before in xml
            xml = xml.replace(before, after)
        return xml

    return change


FREE = '<body pos="5 5 .1"><freejoint/>' + '<geom size=".1"/>' * 20 + "</body>"
LOOK, LIDAR = 'name="look" data="f1tenth_look.xml"', 'name="lidar" data="hokuyo_ust10lx.xml"'
HIDDEN = '<!DOCTYPE mujoco [<!ATTLIST texture file CDATA "/etc/passwd">]>'
VEHICLES = {
    "a texture's file": (added('<asset><texture type="cube" fileup="/etc/passwd"/></asset>'), "'/etc/passwd'> names a"),
    "an include": (added('<include file="/etc/passwd"/>'), "<include>"),
    "a document type": (lambda xml: "<!DOCTYPE mujoco>" + xml, "document type"),
    "an attribute of a document type": (lambda xml: HIDDEN + xml, "document type"),
    "an entity": (lambda xml: '<!DOCTYPE a [<!ENTITY b "<include/>">]>' + xml, "document type"),
    "a robot": (lambda xml: '<robot name="a"/>', "is a URDF or SDF"),
    "two documents": (lambda xml: xml + "<mujoco/>", "no XML: junk"),
    "an unknown element": (added("<assets/>"), "did you mean 'asset'?"),
    "an absolute look": (swapped((LOOK, 'name="look" data="/etc/passwd"')), "text 'look' names '/etc/passwd'"),
    "a look above": (swapped((LOOK, 'name="look" data="../private/a.xml"')), "text 'look' names '../private/a.xml'"),
    "a look by a link": (swapped((LOOK, 'name="look" data="link/a.xml"')), "text 'look' names 'link/a.xml'"),
    "an absolute LiDAR": (swapped((LIDAR, 'name="lidar" data="/etc/passwd"')), "text 'lidar' names '/etc/passwd'"),
    "a LiDAR above": (
        swapped((LIDAR, 'name="lidar" data="../private/a.xml"')),
        "text 'lidar' names '../private/a.xml'",
    ),
    "a LiDAR that is a device": (swapped((LIDAR, 'name="lidar" data="/dev/zero"')), "text 'lidar' names '/dev/zero'"),
    "absolute tires": (added('<custom><text name="tires" data="/etc/passwd"/></custom>'), "text 'tires' names '/etc"),
    "tires above": (added('<custom><text name="tires" data="../private/a.toml"/></custom>'), "text 'tires' names"),
    "tires of home": (added('<custom><text name="tires" data="~/a.toml"/></custom>'), "text 'tires' names"),
    "copies": (added('<worldbody><replicate count="1000000"><site/></replicate></worldbody>'), "count='1000000'"),
    "copies of copies": (
        added("<worldbody>" + 2 * '<replicate count="1000">' + "<site/>" + 2 * "</replicate>" + "</worldbody>"),
        "<replicate> makes more than",
    ),
    "bodies": (added("<worldbody>" + "<body/>" * MOST_BODIES + "</worldbody>"), f"more than {MOST_BODIES} bodies"),
    "elements": (
        added("<worldbody>" + "<site/>" * MOST_ELEMENTS + "</worldbody>"),
        f"more than {MOST_ELEMENTS} elements",
    ),
    "levels": (added("<worldbody>" + "<body>" * 1000 + "</body>" * 1000 + "</worldbody>"), "more than 100 levels"),
    "memory": (swapped(('memory="2M"', 'memory="900G"')), "accepted: at most 1G"),
    "height fields": (added('<asset><hfield nrow="4096" ncol="4096" size="1 1 1 1"/></asset>' * 9), "arrays of more"),
    "a texture": (
        added('<asset><texture builtin="flat" type="cube" width="4096" height="4096"/></asset>'),
        "arrays of",
    ),
    "numbers": (added('<custom><numeric name="n" size="2000000000"/></custom>'), "arrays of more than"),
    "a made mesh": (added('<asset><mesh name="m" builtin="sphere"/></asset>'), "<mesh> makes parts"),
    "the gain of a muscle": (
        added('<actuator><general joint="steering" gaintype="muscle"/></actuator>'),
        "gaintype='muscle'",
    ),
    "a file of nothing else": (lambda xml: xml + " " * 2**24, "has more than 16777216 bytes"),
    "steering without damping": (
        swapped(('damping="0.954"', 'damping="0"'), ('damping="0.023"', 'damping="0"')),
        "damping of the steering is 0",
    ),
    "a drive without gain": (swapped(('kv="41.4816"', 'kv="0"')), "gain of actuator 'speed' is 0"),
    "a drive without radius": (swapped(('coef="0.01225"', 'coef="0"')), "tendon 'drive' has the spin of no wheel"),
    "free bodies": (swapped(("</worldbody>", FREE * 300 + "</worldbody>")), "degrees of freedom"),
    "things in each other": (
        swapped(("</worldbody>", FREE * 20 + "</worldbody>"), ('memory="2M"', 'memory="1G"')), "contacts at rest"
    ),
    "too little memory": (
        swapped(("</worldbody>", FREE * 20 + "</worldbody>"), ('memory="2M"', 'memory="50K"')),
        "memory",
    ),
}  # fmt: skip


@pytest.mark.slow
@each("name", VEHICLES)
def test_a_hostile_vehicle_is_refused_in_one_line(name, here, capsys):
    change, said = VEHICLES[name]
    for file in ("private/a.xml", "private/a.toml"):
        (here / file).write_text(LidarModel.load().text, "utf-8")
    (here / "car/link").symlink_to(here / "private")
    (here / "car/mine.xml").write_text(change(F1TENTH), "utf-8")
    err = refused(here, capsys, "vehicles", "car/mine.xml")
    assert err.startswith("fg-mujoco: vehicle file car/mine.xml: ") and said in err, err
    assert len(err) < 500


def test_what_names_a_file_or_makes_what_it_does_not_list_is_refused_and_numbers_beyond_their_bounds():
    """Of every element and attribute in the tables; a number on a bound is accepted."""
    refused = [(f"<{name}/>", f"<{name}> is not accepted") for name in mjcf.REFUSED_ELEMENTS]
    refused += [(f'<option {name}="1"/>', "is not accepted; accepted: attr") for name in mjcf.REFUSED_ATTRIBUTES]
    refused += [(f'<compiler {name}="/etc"/>', "'/etc'> names a file") for name in mjcf._FILES | mjcf._FOLDERS]
    for name, bounds in mjcf._RANGES.items():
        for bound, side in zip(bounds, (-1.0, 1.0), strict=True):
            assert checked_mjcf(f'<mujoco><option {name}="{bound!r}"/></mujoco>')
            said = f"accepted: {bounds[0]:g} to {bounds[1]:g}"
            refused.append((f'<option {name}="{bound + side * 1e-9 * (abs(bound) or 1.0)!r}"/>', said))
    for text, said in refused:
        with pytest.raises((ValueError, fg.ModelError), match=re.escape(said)):
            checked_mjcf(f"<mujoco>{text}</mujoco>")


def test_a_document_is_written_anew_as_it_was_parsed():
    """Comments, instructions and the declaration are gone; each element is in its line, so that errors name it."""
    text = """<?xml version="1.0"?><?evil a?>
<!-- <include file="a"/> --><mujoco>
  <custom>text<text
     name="a" data="&lt;b&gt; &quot;&amp;&#10;&#x41; 'é'"/>

    <numeric name="n" data="1
 2"/></custom></mujoco>"""
    document = checked_mjcf(text)
    assert document.text.splitlines() == [
        "",
        "<mujoco>",
        '<custom><text name="a" data="&#60;b&#62; &#34;&#38;&#10;A \'é\'"></text>',
        "",
        "",
        '<numeric name="n" data="1  2"></numeric></custom></mujoco>',
    ]
    assert document.texts == (("a", "<b> \"&\nA 'é'"),)
    spec = mujoco.MjSpec.from_string(document.text)
    assert spec.text("a").data == "<b> \"&\nA 'é'" and list(spec.numeric("n").data) == [1.0, 2.0]
    assert checked_mjcf(document.text).text == document.text


def schema():
    """Return the elements of MJCF, and the attributes of those that are not refused, as MuJoCo prints its schema."""
    elements, attributes, skipped = set(), set(), 99  # indentation of a refused element, whose parts do not count
    for line in mujoco.mj_printSchema(False, False).splitlines():
        start = re.match(r"( *)(\S+) \([!*?R]\)", line)
        if start:
            depth, element = len(start[1]), start[2]
            if depth <= skipped:
                elements |= {"body", "worldbody"} if element == "(world)body" else {element}
                skipped = depth if element in mjcf.REFUSED_ELEMENTS else 99
        if skipped == 99:
            attributes |= set(line[start.end() if start else 0 :].split())
    return elements, attributes - {"model"}


def test_every_element_and_attribute_of_mujoco_is_accepted_or_refused_on_purpose():
    elements, attributes = schema()
    assert len(elements) > 100 and len(attributes) > 300
    assert elements - mjcf._ELEMENTS - mjcf.REFUSED_ELEMENTS == set()
    refused = mjcf.REFUSED_ATTRIBUTES | mjcf._FILES | mjcf._FOLDERS
    assert attributes - mjcf._ATTRIBUTES - refused == set()
    assert not mjcf._ATTRIBUTES & refused and not mjcf._ELEMENTS & mjcf.REFUSED_ELEMENTS


def picture(width, height):
    """Return the beginning of a PNG."""
    header = b"IHDR" + struct.pack(">II5B", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header))


CONE = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
MESH = (
    '<mujoco><asset><mesh name="cone" file="{}"/></asset>'
    '<worldbody><frame name="base_link">{}</frame></worldbody></mujoco>'
)
GEOM = '<geom type="mesh" mesh="cone" contype="0" conaffinity="0" mass="0"/>'


def scenery(here, look):
    """Return the model for pictures of a car whose look is a text in a folder of its own."""
    (here / "car/looks/parts").mkdir(parents=True, exist_ok=True)
    (here / "car/looks/mine.xml").write_text(look, "utf-8")
    (here / "car/looks/parts/cone.obj").write_text(CONE, "utf-8")
    (here / "car/mine.xml").write_text(F1TENTH.replace('"f1tenth_look.xml"', '"looks/mine.xml"'), "utf-8")
    return compile_scenery(fg.World("oval", str(here / "car/mine.xml")).xml)


@each("folder", ["", '<compiler meshdir="parts"/>', '<compiler assetdir="./parts"/>'])
def test_a_look_has_meshes_beside_it_and_below(folder, here):
    name = "cone.obj" if folder else "parts/cone.obj"
    model = scenery(here, MESH.format(name, GEOM).replace("<asset>", folder + "<asset>"))
    mesh = model.mesh("look/cone").id
    assert model.mesh_vertnum[mesh] == 4 and mesh in model.geom_dataid


LOOKS = {
    "an absolute mesh": ("/etc/passwd.obj", "is outside of"),
    "a mesh above": ("../../private/a.obj", "is outside of"),
    "a mesh by a link": ("link/a.obj", "is outside of"),
    "a mesh of another kind": ("parts/cone.msh", "ends in .obj or .stl"),
    "a mesh that is not there": ("parts/none.obj", "No such file"),
    "a folder": ("folder.obj", "is a folder"),
}


@pytest.mark.slow
@each("name", LOOKS)
def test_a_look_reads_no_file_outside_of_its_folder(name, here):
    file, said = LOOKS[name]
    (here / "private/a.obj").write_text(CONE, "utf-8")
    (here / "car/looks/folder.obj").mkdir(parents=True)
    (here / "car/looks/link").symlink_to(here / "private")
    with pytest.raises(fg.ModelError, match=re.escape(said)) as refused:
        scenery(here, MESH.format(file, GEOM))
    assert "\n" not in str(refused.value) and "look " in str(refused.value)


@pytest.mark.slow
@each(
    ("asset", "said"),
    [
        ('<compiler meshdir="/etc"/><asset><mesh file="passwd.obj"/></asset>', "is outside of"),
        ('<compiler meshdir="../../private"/><asset><mesh file="a.obj"/></asset>', "is outside of"),
        ('<asset><texture type="2d" file="big.png"/></asset>', "100000 x 100000 pixels"),
        ('<asset><texture type="cube" fileright="big.png"/></asset>', "100000 x 100000 pixels"),
        ('<asset><texture type="2d" file="none.png"/></asset>', "is no PNG"),
        ('<asset><texture type="2d" file="big.ktx"/></asset>', "ends in .png"),
        ('<include file="a.xml"/>', "<include>"),
        ('<asset><skin file="a.skn"/></asset>', "<skin>"),
        ("<!-- --><!DOCTYPE a>", "no XML"),
    ],
)
def test_a_hostile_look_is_refused(asset, said, here):
    (here / "car/looks").mkdir(parents=True)
    (here / "car/looks/big.png").write_bytes(picture(100_000, 100_000))
    (here / "car/looks/none.png").write_bytes(b"P6 1 1 255 aaa")
    with pytest.raises(fg.ModelError, match=said):
        scenery(here, f"<mujoco>{asset}</mujoco>")
