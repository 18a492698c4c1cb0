"""`fg-mujoco render`, `race --video` and what they write: whole files or none, and one line for what is refused."""

import json
import os
import pty
import resource
import signal
import subprocess
import sys

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.errors import SettingsError
from fg_mujoco.pictures.rendering import gl, video
from fg_mujoco.pictures.rendering.gl import INSTALL_COMMAND
from fg_mujoco.pictures.rendering.video import write_video
from rendered import needs_gl
from terminals import read_to_the_end

pytestmark = pytest.mark.usefixtures("here")

Image = pytest.importorskip("PIL.Image", reason="pip install -e '.[render]'")
imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="pip install -e '.[render]'")

SMALL = ["--size", "64x48", "--quality", "draft"]


@pytest.fixture(scope="module")
def run(short_race, tmp_path_factory):
    return str(fg.write_run(short_race, tmp_path_factory.mktemp("runs") / "oval", picture=False))


def frames(count, size=(64, 48)):
    for index in range(count):
        picture = np.zeros((size[1], size[0], 3), np.uint8)
        picture[:, : 1 + index % size[0]] = (250, 40, 40)
        yield picture


def complaint(capsys, *command):
    assert main(["render", *command]) == 2
    captured = capsys.readouterr()
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1 and captured.out == ""
    return lines[0]


@each("name", ["a.mp4", "a.gif"])
def test_video_has_the_frames_at_the_rate(here, name):
    path = write_video(here / name, frames(24), size=(64, 48), fps=12.0)
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert count == 24 and seconds == pytest.approx(2.0, abs=0.15)
    assert [entry.name for entry in here.iterdir()] == [name]
    reader = imageio_ffmpeg.read_frames(str(path))
    assert next(reader)["size"] == (64, 48)
    shown = [np.frombuffer(frame, np.uint8).reshape(48, 64, 3) for frame in reader]
    red = [(frame[24, :, 0] > 150).sum() for frame in shown]
    assert red[0] < 6 < 18 < red[23] < 30


def test_interrupted_video_leaves_what_was_there_before(here):
    (here / "a.mp4").write_bytes(b"an older one")

    def broken():
        yield from frames(5)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(here / "a.mp4", broken(), size=(64, 48))
    assert [entry.name for entry in here.iterdir()] == ["a.mp4"]
    assert (here / "a.mp4").read_bytes() == b"an older one"


def test_disk_that_fills_up_leaves_no_partial_video(here):
    """A limit on the size of files stands for the disk: writing beyond it fails in the encoder."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    noise = np.random.default_rng(0).integers(0, 255, (240, 320, 3)).astype(np.uint8)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, before[1]))
    try:
        with pytest.raises(fg.SettingsError, match=r"a\.mp4: cannot be written: .*accepted: a file in a folder"):
            write_video(here / "a.mp4", (np.roll(noise, i, axis=1) for i in range(60)), size=(320, 240))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(here.iterdir()) == []


def test_encoder_that_dies_is_reported_with_its_last_words(here, monkeypatch):
    script = here / "ffmpeg"
    script.write_text("#!/bin/sh\necho 'No space left on device' >&2\nexit 3\n")
    script.chmod(0o755)
    monkeypatch.setattr(video, "require_encoder", lambda: str(script))
    with pytest.raises(fg.SettingsError, match="No space left on device"):
        write_video(here / "a.mp4", frames(400, (320, 240)), size=(320, 240))
    assert [entry.name for entry in here.iterdir()] == ["ffmpeg"]


@needs_gl
def test_render_writes_a_video_and_says_what_drew_it(here, run, capsys):
    assert main(["render", run, *SMALL, "--fps", "20", "--from", "0.2", "--to", "0.6"]) == 0
    said = capsys.readouterr()
    assert said.err == "" and "oval-chase.mp4: 9 frames of 64 x 48 pixels" in said.out and "through" in said.out
    assert imageio_ffmpeg.count_frames_and_secs("oval-chase.mp4")[0] == 9


@needs_gl
@each("camera", ["chase", "onboard", "top", "track", "orbit"])
def test_one_frame_of_any_camera(here, run, camera):
    assert main(["render", run, *SMALL, "--camera", camera, "--frame", "0.5", "--out", "a.png", "--no-beams"]) == 0
    picture = np.asarray(Image.open("a.png"))
    assert picture.shape == (48, 64, 3) and picture.std() > 10.0


@needs_gl
def test_race_makes_its_video_in_one_go(here, capsys):
    assert main(["race", "--laps", "1", "--time-limit", "0.2", "--video", "a.gif", "--json"]) == 1
    captured = capsys.readouterr()
    assert captured.out.startswith("{") and "a.gif" in captured.err
    assert imageio_ffmpeg.count_frames_and_secs("a.gif")[0] == 7


@each(
    ("options", "message"),
    [
        (["--size", "65x48"], "accepted for MP4: even numbers"),
        (["--frame", "99"], "accepted: 0 to 1.000 s"),
        (["--from", "0.9", "--to", "0.1"], "the earlier first"),
        (["--out", "a.avi"], "accepted: one that ends in .mp4 or .gif"),
        (["--out", "nowhere/a.mp4"], "nowhere/a.mp4: cannot be written: No such file or directory"),
    ],
)
@needs_gl
def test_bad_input_is_refused_in_a_line(here, run, capsys, options, message):
    assert message in complaint(
        capsys, run, *SMALL[2:], *(["--size", "64x48"] if "--size" not in options else []), *options
    )
    assert list(here.iterdir()) == []


ONE_BY_ONE = """
import contextlib, io, json, sys
from fg_mujoco.cli.main import main
for arguments in json.loads(sys.argv[1]):
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = main(arguments)
    print(json.dumps([code, out.getvalue(), err.getvalue()]))
"""
"""Commands one after another in one process: what each returned and said."""


def bare_machine(folder, **environment):
    """The environment of a machine without OpenGL: PyOpenGL ends there as here, in ctypes."""
    (folder / "OpenGL").mkdir(parents=True)
    failure = "raise AttributeError(\"'NoneType' object has no attribute 'eglQueryString'\")\n"
    (folder / "OpenGL" / "__init__.py").write_text(failure)
    variables = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    return variables | {"PYTHONPATH": str(folder)} | environment


def test_without_opengl_the_message_is_the_install_line_and_races_run(here, run):
    bare = bare_machine(here / "bare")
    race = ["race", "--time-limit", "0.1", "--laps", "1"]
    asked = [["render", run, *SMALL], race, [*race, "--video", "a.mp4"]]
    command = [sys.executable, "-c", ONE_BY_ONE, json.dumps(asked)]
    done = subprocess.run(command, capture_output=True, text=True, env=bare)
    drawn, driven, refused = map(json.loads, done.stdout.splitlines())
    assert drawn == [2, "", f"fg-mujoco: 3D pictures need OpenGL: {INSTALL_COMMAND}\n"]
    assert driven[0] == 1 and driven[2] == "" and "time limit" in driven[1]
    assert refused[:2] == [2, ""] and INSTALL_COMMAND in refused[2]


def test_a_process_that_was_forked_from_one_that_has_drawn_is_refused(monkeypatch):
    monkeypatch.setattr(gl, "_PROCESSES", {os.getppid()})
    with pytest.raises(SettingsError, match=r"forked, and OpenGL cannot draw in both; accepted: .*spawn"):
        gl.open_context(16, 16)


@needs_gl
def test_ctrl_c_while_a_video_is_drawn_leaves_nothing_and_progress_is_shown(here, run):
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "fg_mujoco", "render", run, "--size", "640x480", "--fps", "900", "--out", "a.mp4"]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=theirs,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    os.close(theirs)
    shown = b""
    while b"/901" not in shown:  # an OSError where it ends before it has drawn a frame
        shown += os.read(ours, 4096)
    assert list(here.glob(".fg_mujoco-*.partial"))
    process.send_signal(signal.SIGINT)
    shown += read_to_the_end(ours)
    assert process.wait(timeout=60) == 130
    assert b"frame " in shown and b"Traceback" not in shown
    assert list(here.iterdir()) == []
    process.stdout.close()
