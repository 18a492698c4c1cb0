"""Writes frames to a file: MP4 or GIF by its ending, streamed to ffmpeg; PNG for one picture.

A file is written completely or not at all. ffmpeg is that of `imageio-ffmpeg`. It runs in a session of its own, so that
Ctrl-C ends the drawing, and not the file in the middle of a frame.
"""

from __future__ import annotations

import importlib.util
import io
import subprocess
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ...course.writing import require_writable, staged_file, write_file
from ...errors import FgMujocoError, SettingsError, missing_extra
from .telemetry_strip import require_pillow

VIDEO_ENDINGS = (".mp4", ".gif")
"""Of files that frames can be written to."""

_H264 = {  # speed of compression, and its loss: less is better
    "draft": ("ultrafast", "26"),
    "good": ("veryfast", "21"),
    "best": ("slow", "17"),
}
_PALETTE = (
    "split[a][b];[a]palettegen=max_colors=160:stats_mode=diff[p];[b][p]paletteuse=dither=none:diff_mode=rectangle"
)
_LAST_LINES = 2  # of what ffmpeg complains about


def require_encoder() -> str:
    """Return the path of ffmpeg; raise MissingExtraError, with the command that installs it, if there is none."""
    if importlib.util.find_spec("imageio_ffmpeg") is None:
        raise missing_extra("videos need ffmpeg", "render")
    import imageio_ffmpeg

    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise missing_extra("videos need ffmpeg", "render") from error


def check_video(path: str | Path, size: tuple[int, int]) -> Path:
    """Refuse what no video can be written to, before it is drawn.

    Raises:
      SettingsError: another ending, a folder that is not there or cannot be written, or a size that MP4 cannot have.
      MissingExtraError: no encoder here.
    """
    path = Path(path)
    if path.suffix.lower() not in VIDEO_ENDINGS:
        raise SettingsError(f"{path}: is no name for a video; accepted: one that ends in {' or '.join(VIDEO_ENDINGS)}")
    if path.suffix.lower() == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise SettingsError(f"the size is {size[0]} x {size[1]} pixels; accepted for MP4: even numbers")
    require_encoder()
    try:
        require_writable(path)
    except OSError as error:
        raise _unwritable(path, error.strerror or str(error)) from error
    return path


def write_video(
    path: str | Path,
    frames: Iterable[NDArray[np.uint8]],
    *,
    size: tuple[int, int],
    fps: float = 30.0,
    quality: str = "good",
) -> Path:
    """Write frames to a video and return its path; raises as `check_video`. Whatever fails leaves no file.

    Args:
      path: ends in .mp4 or .gif.
      frames: (height, width, 3) uint8 each, taken one by one.
      size: width and height [px].
      fps: frames a second.
      quality: a name in QUALITIES; how well MP4 is compressed.
    """
    path = check_video(path, size)
    try:
        with staged_file(path) as aside:
            _encode(_command(require_encoder(), aside, path.suffix.lower(), size, fps, quality), frames, path)
    except OSError as error:
        if isinstance(error, FgMujocoError):  # of what the frames are drawn from
            raise
        raise _unwritable(path, error.strerror or str(error)) from error
    return path


def write_picture(path: str | Path, picture: NDArray[np.uint8]) -> Path:
    """Write a picture (height, width, 3) as PNG and return its path.

    Raises:
      SettingsError, MissingExtraError: another ending, or a path that cannot be written to; no Pillow here.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise SettingsError(f"{path}: is no name for a picture; accepted: one that ends in .png")
    require_pillow()
    from PIL import Image

    text = io.BytesIO()
    Image.fromarray(picture).save(text, format="png", optimize=True)
    try:
        write_file(path, text.getvalue())
    except OSError as error:
        raise _unwritable(path, error.strerror or str(error)) from error
    return path


def _command(ffmpeg: str, target: Path, ending: str, size: tuple[int, int], fps: float, quality: str) -> list[str]:
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", f"{fps:g}", "-i", "-"]
    if ending == ".gif":
        output = ["-filter_complex", _PALETTE, "-f", "gif"]
    else:
        preset, loss = _H264[quality]
        output = ["-c:v", "libx264", "-preset", preset, "-crf", loss, "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
        output += ["-f", "mp4"]
    return [ffmpeg, "-hide_banner", "-loglevel", "error", "-y", *source, *output, str(target.absolute())]


def _encode(command: list[str], frames: Iterable[NDArray[np.uint8]], path: Path) -> None:
    with tempfile.TemporaryFile() as complaints:
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=complaints, start_new_session=True
        )
        assert process.stdin is not None
        try:
            for frame in frames:
                process.stdin.write(np.ascontiguousarray(frame).data)
            process.stdin.close()
            code = process.wait()
        except BrokenPipeError:  # it has given up, and says why
            code = process.wait() or 1
        except BaseException:
            process.kill()
            with suppress(BrokenPipeError):
                process.stdin.close()
            process.wait()
            raise
        finally:
            with suppress(BrokenPipeError):
                process.stdin.close()
        if code != 0:
            raise _unwritable(path, _last_words(complaints) or f"ffmpeg ended with {code}")


def _last_words(complaints: IO[bytes]) -> str:
    complaints.seek(0)
    lines = complaints.read().decode("utf-8", errors="replace").split("\n")
    return "; ".join([" ".join(line.split()) for line in lines if line.strip()][-_LAST_LINES:])


def _unwritable(path: Path, reason: str) -> SettingsError:
    return SettingsError(
        f"{path}: cannot be written: {reason}; accepted: a file in a folder that can be, with room for it"
    )
