"""MJCF that others may have made: parsed and checked once, and written anew, so that MuJoCo reads what was checked.

    document = checked_mjcf(text)
    spec = mujoco.MjSpec.from_string(document.text, assets=document.files)

This is the one way to MuJoCo of vehicles, of their LiDARs and looks, and of the scenes of run folders. What is accepted
is listed: the elements and attributes of which MuJoCo makes about as much as stands in the text. A document names no
file, unless a folder is given; then meshes and pictures may lie in it, and are read here, each up to a limit of size.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any
from xml.parsers import expat

from ..errors import nearest
from .files import read_bytes

MOST_MJCF = 16 * 2**20
"""Bytes of a document."""
MOST_ELEMENTS, MOST_BODIES = 50_000, 5000
"""Of a document, copies included: MuJoCo reads so many in one to three seconds, and ten times as many in minutes."""

_MOST_LEVELS = 100
_MOST_COPIES = 20_000  # elements that `replicate` makes; MuJoCo looks through all of them for each
_MOST_MADE = 2**28  # bytes of arrays that a document asks for and does not list
_MOST_FILE, _MOST_FILES = 64 * 2**20, 256 * 2**20  # bytes of a mesh or picture, and of all
_MOST_PIXELS = 2**24
_MESHES, _PICTURES = (".obj", ".stl"), (".png",)
_NO_RGBA = (0.5, 0.5, 0.5, 1.0)  # that MuJoCo takes for none: then the material's counts


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_ELEMENTS = _words(
    """
    mujoco compiler option flag size statistic visual global quality headlight map scale rgba
    default asset mesh texture material layer hfield worldbody body frame replicate inertial joint freejoint geom site
    camera light contact pair exclude equality connect weld tendon spatial fixed pulley custom numeric text tuple
    element keyframe key
    actuator general motor position velocity intvelocity orientation pid damper cylinder adhesion dcmotor
    sensor touch accelerometer velocimeter gyro force torque magnetometer camprojection rangefinder jointpos jointvel
    tendonpos tendonvel actuatorpos actuatorvel actuatorfrc jointactuatorfrc tendonactuatorfrc ballquat ballangvel
    jointlimitpos jointlimitvel jointlimitfrc tendonlimitpos tendonlimitvel tendonlimitfrc framepos framequat
    framexaxis frameyaxis framezaxis framelinvel frameangvel framelinacc frameangacc subtreecom subtreelinvel
    subtreeangmom insidesite distance normal fromto e_potential e_kinetic clock tactile user
    """
)
REFUSED_ELEMENTS = _words(
    """
    include attach model extension plugin instance config composite flexcomp flex flexvert flexstrain edge elasticity
    pin deformable skin bone lengthrange muscle
    """
)
"""Elements of MJCF that are not accepted: they name files, make parts that they do not list, or are simulated first."""

_ATTRIBUTES = _words(
    """
    accel act actdim actearly active actlimited actrange actuation actuator actuatorfrclimited actuatorfrcrange
    actuatorgravcomp actuatorgroupdisable actuatorlength actuatornegative actuatorpositive actuatortendon
    actuatorwidth adhesion align alignfree alpha ambient anchor angle area armature attenuation autolimits autoreset
    axis axisangle azimuth balanceinertia bias biasprm biastype body body1 body2 boundinertia boundmass builtin
    bulbradius bv bvactive camera cameraid castshadow ccd_iterations ccd_tolerance center childclass clampctrl class
    coef cogging colorspace com conaffinity condim cone conflict connect constraint contact contactforce
    contactfriction contactgap contactheight contactpoint contacttorque contactwidth controller contype coordinate
    count crankbroken cranklength cranksite ctrl ctrllimited ctrlrange cutoff damper damping dampratio data datatype
    delay density diagexact diaginertia diameter diffuse dim dir directional discardvisual divisor dynprm dyntype
    elevation ellipsoidinertia emission enclosed energy equality euler eulerdamp eulerseq exponent extent face
    ffrange filterparent fitaabb fitscale fluidcoef fluidshape focal focalpixel fog fogend fogstart force
    forcelimited forcerange forcewidth fovy fpmax framelength framewidth friction frictionloss fromto frustum
    fullinertia fuse fusestatic fvmax fwdinv gain gainprm gaintype gap gear geom geom1 geom2 glow gravcomp gravity
    gridlayout gridsize group haze height hfield hflip imax impratio inductance inertia inertiafromgeom
    inertiagrouprange inheritrange input integrator intensity interp interval invdiscrete ipc ipd island iterations
    jacobian joint joint1 joint2 jointinparent jointlength jointwidth ki kp kv lengthrange light limit limited
    linewidth lmax lmin ls_iterations ls_tolerance lugre magnetic margin mark markrgb mass material maxhullvert
    meaninertia meanmass meansize memory mesh metallic midphase mocap mode motorconst mpos mquat multiccd name
    nativeccd nchannel ncol nconmax needstage njmax nkey noise nominal normal noslip_iterations noslip_tolerance
    nrow nsample nstack num numquads numslices numstacks nuser_actuator nuser_body nuser_cam nuser_geom nuser_jnt
    nuser_sensor nuser_site nuser_tendon nuserdata o_friction o_margin o_solimp o_solref objname objtype offheight
    offsamples offset offwidth orthographic output override polycoef pos posrange principal principalpixel priority
    prm projection qpos quat qvel random range rangefinder
    realtime reduce ref reflectance refname refpos refquat refsafe
    refsite reftype relpose resistance resolution rgb1 rgb2 rgba role roughness saturation saveinertial scale
    sdf_initpoints sdf_iterations selectpoint sensor sensorsize sep settotalmass shadowclip shadowscale shadowsize
    shellinertia shininess sidesite simple site site1 site2 size sleep sleep_tolerance slewmax slidercrank
    slidersite smoothnormal softness solimp solimpfriction solimplimit solmix solref solreffriction solreflimit
    solver specular spring springdamper springlength springref stiffness stiffnessrot subtree1 subtree2 surfacevel
    target tausmooth tendon tendon1 tendon2 texcoord texrepeat texture texuniform thermal time timeconst timestep
    tolerance torque torquescale type user usethread velrange vertex vflip viscosity vmax warmstart width wind
    xyaxes zaxis zfar znear
    """
)
_FILES = _words("file fileright fileleft fileup filedown filefront fileback")
_FOLDERS = _words("assetdir meshdir texturedir")
REFUSED_ATTRIBUTES = _words("""
    strippath content_type savecanonical savecompiled passthrough embed params
    springyield plastic speculative
    """)  # the last three are of MuJoCo 4 only; plastic springs have a state that no run keeps
"""Attributes of accepted elements of MJCF that are not accepted, besides those of files and folders."""

_RANGES: dict[str, tuple[float, float]] = {
    "timestep": (1e-4, 0.1),  # [s]
    **dict.fromkeys(("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations"), (0.0, 1000.0)),
    **dict.fromkeys(("sdf_iterations", "sdf_initpoints"), (0.0, 1000.0)),
    **dict.fromkeys(("tolerance", "ls_tolerance", "noslip_tolerance", "ccd_tolerance"), (1e-15, 1.0)),  # of 0 no end
    **dict.fromkeys(("width", "height", "nrow", "ncol", "resolution", "offwidth", "offheight"), (0.0, 4096.0)),
    **dict.fromkeys(("shadowsize", "numslices", "numstacks", "numquads"), (0.0, 8192.0)),
    "offsamples": (0.0, 16.0),
    "nchannel": (1.0, 4.0),
    **dict.fromkeys(("nuserdata", "njmax", "nconmax", "dim", "num", "nsample"), (-1.0, 10_000.0)),
    "nkey": (0.0, 100.0),
    "nstack": (-1.0, 1e7),
    "count": (0.0, 2000.0),
    **{
        f"nuser_{part}": (-1.0, 100.0)
        for part in ("body", "jnt", "geom", "site", "cam", "tendon", "actuator", "sensor")
    },
}
"""Within what attributes have to be that say how much MuJoCo makes or does."""

_MEMORY = re.compile(r"-1|\d{1,9}K?|\d{1,4}M|1G")
_NO_NUMBER = re.compile(r"(?i)(?<!\S)(?:[+-]?(?:nan|inf|infinity)|[+-]?[\d.]+e[+-]?\d{3,})(?!\S)")
_ESCAPES = {ord(sign): f"&#{ord(sign)};" for sign in '&<>"\n\r\t'}


@dataclass(frozen=True, kw_only=True)
class Mjcf:
    """A document that was checked."""

    text: str = field(repr=False)  # written anew: elements and attributes, each in its line, and nothing else
    texts: tuple[tuple[str, str], ...] = ()  # names and data of its custom texts
    files: Mapping[str, bytes] = field(default_factory=dict, repr=False)  # contents, by the names that `text` has


def checked_mjcf(text: str, *, folder: Path | None = None) -> Mjcf:
    """Return the document of an MJCF text of one <mujoco> with all else.

    Meshes and pictures that it names lie in `folder`; None: it may name none.

    Raises:
      ValueError: no XML, a document type, or what is not accepted; the message says what is.
    """
    if folder is None:
        return _checked(text)
    return _Reader(folder).read(text)


@lru_cache(maxsize=16)
def _checked(text: str) -> Mjcf:
    return _Reader(None).read(text)


def show_as_drawn(spec: Any) -> Any:
    """Let rays meet a geom of an MjSpec where pictures show it, and no other, in place; return the spec.

    Pictures take the alpha of a geom's own rgba, where it has one, and rays that of its material. Where only one of the
    two is 0, the geom loses its material.
    """
    for geom in spec.geoms:
        material = spec.material(geom.material) if geom.material else None
        own = tuple(float(part) for part in geom.rgba) != _NO_RGBA
        if material is not None and own and (geom.rgba[3] == 0.0) != (material.rgba[3] == 0.0):
            geom.material = ""
    return spec


def inside(folder: Path, name: str) -> Path | None:
    """Return the path of a file in a folder, or below; None where a name leads elsewhere, by a link, too."""
    if not name or "\0" in name or len(name) > 1000 or Path(name).is_absolute() or ".." in Path(name).parts:
        return None
    try:
        return folder / name if (folder / name).resolve().is_relative_to(folder.resolve()) else None
    except (OSError, RuntimeError):  # a circle of links
        return None


class _Reader:
    """Writes a document anew while expat reads it."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._parser = expat.ParserCreate("utf-8")
        self._parser.StartDoctypeDeclHandler = self._refuse_document_type
        self._parser.StartElementHandler, self._parser.EndElementHandler = self._begin, self._end
        self._written: list[str] = []
        self._line = 1  # of what is written
        self._copies = [1]  # of each open element, and of what is in it
        self._counts: Counter[str] = Counter()
        self._folders: dict[str, str] = {}
        self._names: list[tuple[int, str, str, str]] = []  # place in what is written, element, attribute, file
        self._files: dict[str, bytes] = {}
        self._texts: list[tuple[str, str]] = []

    def read(self, text: str) -> Mjcf:
        try:
            content = text.encode()
            if len(content) > MOST_MJCF:
                raise ValueError(f"more than {MOST_MJCF} bytes; accepted: as much at most")
            self._parser.Parse(content, True)
        except expat.ExpatError as error:
            raise ValueError(f"no XML: {error}; accepted: MJCF") from error
        for place, tag, name, file in self._names:  # the folder's name may come behind
            self._written[place] = self._take(tag, name, file)
        return Mjcf(text="".join(self._written), texts=tuple(self._texts), files=self._files)

    def _refuse_document_type(self, *_: Any) -> None:
        raise ValueError("it declares a document type; accepted: MJCF alone")

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        level = len(self._copies)
        if level > _MOST_LEVELS:
            raise ValueError(f"more than {_MOST_LEVELS} levels of elements; accepted: as many at most")
        if (tag == "mujoco") != (level == 1):
            raise ValueError(f"<{short_text(tag)}> in level {level}; accepted: one <mujoco> with all else")
        if tag not in _ELEMENTS:
            raise ValueError(self._unknown_element(tag))
        line = self._parser.CurrentLineNumber
        self._written.append("\n" * (line - self._line) + f"<{tag}")
        self._line = line
        for name, value in attributes.items():
            if self._is_folder(tag, name, value):
                continue
            self._check_attribute(tag, name, value)
            if name in _FILES:
                self._names.append((len(self._written), tag, name, value))
            self._written.append(f' {name}="{value.translate(_ESCAPES)}"')
        self._written.append(">")
        self._count(tag, attributes)
        if tag == "text":
            self._texts.append((attributes.get("name", ""), attributes.get("data", "")))

    def _end(self, tag: str) -> None:
        self._copies.pop()
        self._written.append(f"</{tag}>")

    def _unknown_element(self, tag: str) -> str:
        """Return why an element is refused."""
        if tag in REFUSED_ELEMENTS:
            return f"<{tag}> is not accepted; accepted: a document that lists all its parts and refers to no other file"
        near = nearest(tag, _ELEMENTS)
        meant = f"; did you mean {near!r}?" if near else ""
        return f"<{short_text(tag)}> is unknown; accepted: elements of MJCF{meant}"

    def _count(self, tag: str, attributes: dict[str, str]) -> None:
        """Count an element and what MuJoCo makes of it, once for each copy."""
        copies = self._copies[-1]
        times = max(_whole(attributes.get("count", "1")), 1) if tag == "replicate" else 1
        self._copies.append(copies * times)
        counts = self._counts
        counts["elements"] += copies
        counts["bodies"] += copies * (tag == "body")
        counts["copies"] += copies if copies > 1 else 0
        counts["bytes"] += copies * _bytes_made(tag, attributes)
        if counts["copies"] > _MOST_COPIES:
            raise ValueError(f"<replicate> makes more than {_MOST_COPIES} elements; accepted: as many at most")
        if counts["elements"] > MOST_ELEMENTS:
            raise ValueError(f"more than {MOST_ELEMENTS} elements; accepted: as many at most")
        if counts["bodies"] > MOST_BODIES:
            raise ValueError(f"more than {MOST_BODIES} bodies; accepted: as many at most")
        if counts["bytes"] > _MOST_MADE:
            called = " ".join(f"{name}={short_text(repr(attributes[name]))}" for name in _MAKING if name in attributes)
            raise ValueError(f"<{tag} {called}>: arrays of more than {_MOST_MADE} bytes; accepted: as much at most")

    def _is_folder(self, tag: str, name: str, value: str) -> bool:
        """Take the folder of files that a compiler names, which is not written."""
        if tag != "compiler" or name not in _FOLDERS or self._folder is None:
            return False
        self._folders[name] = value
        return True

    def _check_attribute(self, tag: str, name: str, value: str) -> None:
        """Raise ValueError for an attribute that names a file, asks for too much, or is not accepted."""
        called = f"<{tag} {short_text(name)}={short_text(repr(value))}>"
        if name in _FILES or name in _FOLDERS:
            if self._folder is None or name in _FOLDERS or tag not in ("mesh", "texture", "hfield"):
                raise ValueError(
                    f"{called} names a file; accepted: a document that refers to no other file (meshes and pictures "
                    "belong to the look)"
                )
            return
        if name not in _ATTRIBUTES and not (tag == "mujoco" and name == "model"):
            near = nearest(name, _ATTRIBUTES, cutoff=0.8) if name not in REFUSED_ATTRIBUTES else None
            meant = f"; did you mean {near!r}?" if near else ""
            raise ValueError(f"{called} is not accepted; accepted: attributes of MJCF that say what is there{meant}")
        if name in ("gaintype", "biastype") and value == "muscle":  # MuJoCo simulates its lengths, here without an end
            raise ValueError(f"{called} is not accepted; accepted: fixed, affine, none")
        if tag == "mesh" and name == "builtin":
            raise ValueError(f"{called}: <mesh> makes parts that it does not list; accepted: all parts by themselves")
        if name == "memory" and not _MEMORY.fullmatch(value):
            raise ValueError(f"{called}; accepted: at most 1G")
        found = None if name in ("name", "data") and tag == "text" else _NO_NUMBER.search(value)
        if found is not None:
            raise ValueError(f"<{tag} {name}> has {found[0]}; accepted: numbers up to 1e99")
        if name in _RANGES:
            low, high = _RANGES[name]
            if not all(low <= _number(number) <= high for number in value.split()):
                raise ValueError(f"{called}; accepted: {low:g} to {high:g}")

    def _take(self, tag: str, name: str, file: str) -> str:
        """Read a file of the folder, and return the attribute that names it by what it holds."""
        called = f"<{tag} {name}={short_text(repr(file))}>"
        assert self._folder is not None
        kinds = _MESHES if tag == "mesh" else _PICTURES
        if PurePosixPath(file).suffix.lower() not in kinds:
            raise ValueError(f"{called}; accepted: a file that ends in {' or '.join(kinds)}")
        at = self._folders.get("meshdir" if tag == "mesh" else "texturedir", self._folders.get("assetdir", ""))
        path = inside(self._folder, str(PurePosixPath(at, file)))
        if path is None:
            raise ValueError(f"{called} is outside of {self._folder}; accepted: a file in this folder, or below")
        try:
            content = read_bytes(path, _MOST_FILE)
        except OSError as error:
            raise ValueError(f"{called}: {path}: {error.strerror or error}; accepted: a file") from error
        if tag != "mesh":
            _check_picture(content, called)
        key = f"{hashlib.sha256(content).hexdigest()[:16]}/{path.name}"
        self._files[key] = content
        if sum(map(len, self._files.values())) > _MOST_FILES:
            raise ValueError(f"{called}: all files have more than {_MOST_FILES} bytes; accepted: as much at most")
        return f' {name}="{key.translate(_ESCAPES)}"'


_MAKING = ("nrow", "ncol", "width", "height", "size", "nsample", "dim", "num")


def _bytes_made(tag: str, attributes: Mapping[str, str]) -> int:
    """Return the number of bytes of arrays that MuJoCo makes of an element that is not listed."""

    def value(name: str) -> int:
        return _whole(attributes.get(name, "0"))

    if tag == "hfield":
        return 16 * value("nrow") * value("ncol")
    if tag == "texture":
        return 6 * 4 * value("width") * max(value("height"), value("width"))
    if tag == "numeric":
        return 8 * value("size")
    return 8 * (value("nsample") * 16 + value("dim") + value("num") * 17)


def _check_picture(content: bytes, called: str) -> None:
    """Refuse what is no PNG, or one of too many pixels, by its header."""
    width, height = (int.from_bytes(content[place : place + 4], "big") for place in (16, 20))
    if content[:8] != b"\x89PNG\r\n\x1a\n" or content[12:16] != b"IHDR":
        raise ValueError(f"{called} is no PNG; accepted: a PNG")
    if width * height > _MOST_PIXELS:
        raise ValueError(f"{called}: {width} x {height} pixels; accepted: {_MOST_PIXELS} at most")


def _whole(text: str) -> int:
    """Return the whole number of a text, from 0; 0 of what is none."""
    number = _number(text)
    return int(min(number, 1e12)) if number > 0.0 else 0


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def short_text(text: str) -> str:
    """Return a text in one line, cut to 60 characters."""
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
