"""The native core: the same bits in each build, indices within bounds, refused arrays, and broken builds."""

import ctypes
import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cases import each
from fg_mujoco import native
from fg_mujoco.errors import EngineError
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.lidar.scanline import scan
from fg_mujoco.lidar.visible_surfaces import ScanlineScene, SceneArrays, Scratch
from fg_mujoco.native_arrays import ArrayTable
from fg_mujoco.vehicle.tire_rows import GEAR, TIRE
from lidar_worlds import EYE, random_poses, random_spec

SOURCES = Path(__file__).parents[2] / "native"
HEADERS = "<algorithm> <array> <cmath> <cstdint> <memory> <numbers> <stdexcept> <string> <vector>"
SCENES = 3
SCANS = 60

needs_sources = pytest.mark.skipif(not SOURCES.exists(), reason="not a checkout of the repository")


def scene_and_poses(seed):
    """A scene of boxes, meshes, planes and round shapes, and random poses of the LiDAR and of what moves."""
    rng = np.random.default_rng(seed)
    model = random_spec(rng).compile()
    scene = ScanlineScene(model, LidarModel.load().beams, model.body(EYE).id)
    bodies = len(scene.moving) + 1
    poses = [random_poses(rng, bodies) for _ in range(SCANS)]
    odd = [(np.full((bodies, 3), place), poses[0][1]) for place in (np.nan, 1e300)]
    return scene, poses + odd


def scans(library):
    """All scans of all scenes by the function in C of a library."""
    function = ctypes.CDLL(str(library)).fg_scan
    function.argtypes = [ctypes.c_void_p] * 7 + [ctypes.c_int64]
    found = []
    for seed in range(SCENES):
        scene, poses = scene_and_poses(seed)
        arrays = ArrayTable(SceneArrays._fields, scene.arrays._asdict())
        scratch = ArrayTable(Scratch._fields, scene.scratch()._asdict())
        for positions, rotations in poses:
            out, moving = np.empty(scene.arrays.beams.shape[1]), (positions[1:], rotations[1:])
            given = (positions, rotations, *moving, out)
            function(arrays.address, scratch.address, *(array.ctypes.data for array in given), -1)
            found.append(out)
    return np.array(found)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """What builds the functions in C alone, in some variant, and returns the library."""
    cmake = shutil.which("cmake")
    if cmake is None:
        pytest.skip("there is no cmake here")

    headers = tmp_path_factory.mktemp("headers") / "headers.cmake"  # which are then compiled once for all files
    headers.write_text(f"cmake_language(DEFER CALL target_precompile_headers caster PRIVATE {HEADERS})\n")

    @cache
    def build(*options):
        folder = tmp_path_factory.mktemp("build")
        python = f"-DPython_EXECUTABLE={sys.executable}"  # whose MuJoCo it is built for
        options = ("-DFG_PYTHON=OFF", f"-DCMAKE_PROJECT_INCLUDE={headers}", python, *options)
        made = [cmake, "-S", str(SOURCES), "-B", str(folder), *options]
        for command in (made, [cmake, "--build", str(folder), "--target", "caster", "--parallel", "2"]):
            done = subprocess.run(command, capture_output=True, text=True)
            assert done.returncode == 0, done.stdout + done.stderr
        (library,) = (path for path in folder.iterdir() if path.name.startswith("libcaster."))
        return library

    return build


@needs_sources
@pytest.mark.slow
@each("options", [("-DFG_LEVEL=-O1",), ("-DFG_LEVEL=-O0", "-DFG_CHECK_BOUNDS=ON")], ids=["O1", "O0, bounds checked"])
def test_each_build_gives_the_same_bits_and_no_index_is_out_of_range(options, built):
    """An index out of range ends the process of this test."""
    assert scans(built(*options)).tobytes() == scans(native.core.__file__).tobytes()


@needs_sources
@pytest.mark.slow
def test_a_build_with_checks_of_bounds_finds_an_index_that_is_out_of_range(built, tmp_path):
    library = built("-DFG_LEVEL=-O0", "-DFG_CHECK_BOUNDS=ON")
    program = (
        "import ctypes, numpy as np\n"
        f"scan = ctypes.CDLL({str(library)!r}).fg_scan\n"
        "arrays, room = np.zeros((10, 4), np.int64), np.zeros(99)\n"
        "arrays[0, 0], arrays[0, 1:3] = room.ctypes.data, (4, 5)  # beams, and nothing else\n"
        "address = ctypes.c_void_p(room.ctypes.data)\n"
        "scan(ctypes.c_void_p(arrays.ctypes.data), ctypes.c_void_p(arrays.ctypes.data), *[address] * 5,\n"
        "     ctypes.c_int64(-1))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode != 0 and "index out of range" in done.stderr


# --- arguments ---


@pytest.fixture
def arguments():
    scene, poses = scene_and_poses(0)
    positions, rotations = poses[0]
    out = np.empty(scene.arrays.beams.shape[1])
    moving = {"moving_positions": positions[1:], "moving_rotations": rotations[1:]}
    own = {"position": positions[0], "rotation": rotations[0]}
    return {"scene": scene.arrays, "scratch": scene.scratch(), "out": out} | own | moving


CHANGES = {
    "another type": lambda array: array.astype(np.float32),
    "not contiguous": lambda array: np.repeat(array, 2, axis=-1)[..., ::2],
    "a list": lambda array: array.tolist(),
}


@each("name", ["position", "rotation", "moving_positions", "moving_rotations", "out"])
@each("change", CHANGES.values(), ids=CHANGES)
def test_arrays_of_another_type_are_refused_and_not_copied(arguments, name, change):
    scan(**arguments)
    with pytest.raises(TypeError, match="dtype=float64"):
        scan(**arguments | {name: change(arguments[name])})


def test_a_read_only_array_that_is_written_to_is_refused(arguments):
    arguments["out"].flags.writeable = False
    with pytest.raises(TypeError, match="scan"):
        scan(**arguments)


@each(
    ("name", "said"),
    [("position", "pose is not"), ("out", "as many numbers as the scene has beams"), ("moving_positions", "that move")],
)
def test_arrays_of_another_length_are_refused(arguments, name, said):
    with pytest.raises(ValueError, match=said):
        scan(**arguments | {name: arguments[name][:-1].copy()})


@each(
    ("name", "row", "said"),
    [("spans", 1, "edges, triangles or"), ("frames", 1, "clusters, planes or shapes"), ("triangles", 0, "an edge")],
)
def test_a_scene_whose_indices_point_outside_its_arrays_is_refused(arguments, name, row, said):
    array = getattr(arguments["scene"], name).copy()
    array[0, row] = np.iinfo(array.dtype).max
    with pytest.raises(ValueError, match=said):
        scan(**arguments | {"scene": arguments["scene"]._replace(**{name: array})})


def test_scratch_arrays_of_another_scene_are_refused(arguments):
    small = arguments["scratch"]._replace(nearest=np.empty(1))
    with pytest.raises(ValueError, match="scratch arrays are not those of this scene"):
        scan(**arguments | {"scratch": small})


NO_TIRES, SLIP = np.zeros(0, TIRE), np.zeros((10, 2, 4))


@each(
    ("name", "given", "said"),
    [
        ("curve_force", (0, np.zeros(5), 0.1), "numbers is not"),
        ("look_at_floor", (0.0, 0.0, 0.0, *(np.zeros(of) for of in ((4, 2), (1, 7), 3, 4))), "patches, mu and under"),
        ("measure_slip", (np.zeros((2, 80)), 0, -1, np.ones((1, 4)), NO_TIRES, SLIP[0], 0, SLIP[:9]), "slip is not"),
        ("measure_slip", (np.zeros((2, 80)), 5, -1, np.ones((1, 4)), NO_TIRES, SLIP[0], 0, SLIP), "tires' readings"),
        ("measure_slip", (SLIP[0], 0, -1, np.ones((1, 4)), np.zeros(4, TIRE), SLIP[0], 0, SLIP), "or their states"),
        ("step_on_tires", (0, 0, np.zeros(1, GEAR), NO_TIRES, np.ones((2, 4)), True), "gears and mu are not"),
    ],
)
def test_arrays_of_tires_that_do_not_fit_together_are_refused(name, given, said):
    with pytest.raises(ValueError, match=said):
        getattr(native.core, name)(*given)


# --- the build ---


def failure(code, tmp_path, **environment):
    """What a program in a folder prints last on stderr."""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, env={**os.environ, **environment}
    )
    assert done.returncode != 0
    return done.stderr.strip().splitlines()[-1]


BROKEN = """
import sys, types
from importlib.machinery import ModuleSpec
class Finder:
    def find_spec(self, name, path=None, target=None):
        return ModuleSpec(name, self) if name == "fg_mujoco._native" else None
    def create_module(self, spec):
        {what}
    def exec_module(self, module):
        pass
sys.meta_path.insert(0, Finder())
import fg_mujoco.native
"""


@each(
    ("what", "said"),
    [
        ("raise ImportError('/x/_native.so: file too short')", "does not load in CPython 3"),
        ("return types.ModuleType('fg_mujoco._native')", "has interface None, and these sources need"),
    ],
    ids=["half a library", "built of other sources"],
)
def test_a_broken_build_is_named_in_one_line_with_the_command_that_mends_it(what, said, tmp_path):
    line = failure(BROKEN.format(what=what), tmp_path)
    assert line.startswith("fg_mujoco.errors.EngineError: the native core") and said in line and "make native" in line


def test_a_command_on_a_broken_build_says_so_in_one_line_and_exits_with_2(tmp_path):
    code = "import sys; sys.argv = ['fg-mujoco']" + BROKEN.format(what="return types.ModuleType('fg_mujoco._native')")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2
    assert re.fullmatch("fg-mujoco: the native core has interface None.*make native.*\n", done.stderr)


def is_refused(library, said):
    """Whether a library is named in one line, with the command that mends it."""
    with pytest.raises(EngineError) as refused:
        native.load_mujoco(str(library))
    return re.fullmatch(f"{library} .*{said}.*; to build it: make native.*", str(refused.value))


@each(("library", "said"), [("none.so", "is no library"), (native.core.__file__, "has no function mj_version")])
def test_a_library_that_is_not_that_of_mujoco_is_named_in_one_line(library, said):
    assert is_refused(library, said)


@each(
    ("version", "said"), [(99001002, "is MuJoCo 99.1.2, but .* for MuJoCo"), (mujoco.mj_version(), "no function mj_")]
)
def test_another_mujoco_is_named_in_one_line_with_the_command_that_mends_it(version, said, tmp_path):
    compiler, source, library = shutil.which("cc"), tmp_path / "other.c", tmp_path / f"{version}.so"
    if compiler is None:
        pytest.skip("there is no C compiler here")
    source.write_text(f"int mj_version(void) {{ return {version}; }}")
    subprocess.run([compiler, "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
    assert is_refused(library, said)


@pytest.mark.skipif(platform.machine() != "x86_64" or platform.libc_ver()[0] != "glibc", reason="of glibc on x86-64")
def test_with_one_variant_of_the_c_library_an_older_processor_gives_the_same_bits():
    """As docs/concepts.md says. NumPy's variants change nothing."""
    race = "import fg_mujoco as fg; print(fg.race('hairpins', time_limit=3.0).trajectory_sha256)"
    told = "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2"
    found = set()
    for without, numpys in (("", ""), (",-AVX,-SSE4_1", ""), ("", "X86_V3 X86_V4")):
        environment = {**os.environ, "GLIBC_TUNABLES": told + without, "NPY_DISABLE_CPU_FEATURES": numpys}
        command = [sys.executable, "-W", "ignore", "-c", race]
        found.add(subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout)
    assert len(found) == 1


def needed_by(**environment):
    """The process that tells what a build needs."""
    command, environment = [sys.executable, str(SOURCES / "build_backend.py")], {**os.environ, **environment}
    return subprocess.run(command, capture_output=True, text=True, cwd=SOURCES.parent, env=environment)


@needs_sources
@each(("compiler", "said"), [("/none/c++", "does not run"), ("false", "does not compile C++20")])
def test_a_build_with_a_compiler_that_does_not_do_says_in_one_line_what_to_install(compiler, said):
    pytest.importorskip("scikit_build_core")
    done = needed_by(CXX=compiler)
    assert done.returncode == 1 and said in done.stderr and len(done.stderr.splitlines()) == 1


@needs_sources
def test_a_build_without_a_compiler_takes_that_of_a_package_and_says_so(tmp_path):
    pytest.importorskip("scikit_build_core")
    done = needed_by(PATH=str(tmp_path))
    assert done.returncode == 0 and "ziglang==" in done.stdout and "ziglang" in done.stderr
    assert "ziglang" not in needed_by().stdout


@needs_sources
def test_the_native_core_is_built_of_the_sources_that_there_are():
    """Else `make native` has not run since they were changed."""
    found = sorted(
        path.relative_to(SOURCES).as_posix()
        for path in SOURCES.rglob("*")
        if path.suffix in (".cpp", ".hpp") or path.name == "CMakeLists.txt"
    )
    lines = [f"{name} {hashlib.sha256((SOURCES / name).read_bytes()).hexdigest()}\n" for name in found]
    assert hashlib.sha256("".join(lines).encode()).hexdigest() == native.core.SOURCES
