"""A DevKit of AutoDRIVE as a planner: in each tick it is told what its car senses, and its answer is the command.

A packet is sent in each frame, of which there are RATE in a second, and the answer to it acts LATE frames later: it
shows in the packet after that, the third, as in the league's simulator. In lockstep a frame waits for the answer, so
that the same DevKit gives the same race. Of several answers to a packet the last counts. What comes before a packet is
sent answers an earlier one, and is not believed. In real time a tick takes as long as on a car, and frames wait for
answers that are late.

A DevKit that does not answer the first packet, while its connection lives, is sent the packets of classic DevKits.
"""

from __future__ import annotations

import base64
import io
import math
import time
import warnings
from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.addons.ros import front_camera
from fg_mujoco.course.lap_timer import LapTimer
from fg_mujoco.errors import ControllerError, EngineError, SettingsError, missing_extra
from fg_mujoco.messages import STOP, DriveCommand, LaserScan, Odometry, shown
from fg_mujoco.simulation.planner_adapter import Surroundings

from .packets import EVENT, Answer, LapTimes, packet, read_answer
from .socket_io import open_client

PORT = 4567
"""Port on which the DevKit of the league listens."""

PATIENCE = 10.0
"""[s] of wall time after which a DevKit that has not answered is taken to be gone."""

RATE, LATE = 20.0, 2
"""[Hz] of the exchange, and frames from a packet until its answer acts. A team of the league measured 17 to 20 Hz, and
three frames until a command shows in what it is sent: raceline/VEHICLE_MODEL.md of
Abdullah-Bin-Naeem/RoboRacer-Staged-Curriculum-RL-and-Raceline-Optimization, at 15975173."""

WHEEL_RADIUS = 0.059
"""[m] of the simulator's car, by which DevKits make distances of the encoders' angles. Source: its technical guide."""

_SETTLE = 0.1  # [s] within which further answers to a packet follow
_MOST_EXTRA, _FORGOTTEN = 5.0, 0.1  # answers that were not waited for; of them are forgotten in a tick

_REAR = slice(2, 4)  # of the wheel speeds of an odometry
_SAME_TIME = 1e-9  # [s]
_BLANK_SIZE = (16, 9)
_QUALITY = 75  # of the JPEG, in percent: the guide


Camera = Callable[[Surroundings, Odometry], str]
"""Returns the picture of the front camera, a JPEG in base64."""


class DevKit:
    """The connection to a DevKit at HOST:PORT, which drives one car.

    In `real_time` a tick takes as long as on a car; else it waits for the answer, see PATIENCE. Whoever races the car
    writes its `collisions`. `reset_asked`: the DevKit has asked for the simulation to begin anew; one that keeps asking
    has asked once.
    Raises SettingsError: no address, or a patience that is no positive time; EngineError: no DevKit answers there;
    MissingExtraError: the extra `autodrive` is not installed.
    """

    def __init__(self, address: str, camera: Camera, *, real_time: bool = False, patience: float = PATIENCE) -> None:
        if not 0.0 < patience < math.inf:
            raise SettingsError(f"patience is {shown(patience)}; accepted: a positive number of seconds")
        self.address, self._camera, self._real_time, self._patience = address, camera, real_time, patience
        self._client = open_client(*split_address(address), EVENT)
        self._heard = self._classic = self._reset_held = False
        self._answers, self._extra = 0, 0.0  # to a packet, 0: not known; that were not waited for
        self.reset()

    def __enter__(self) -> DevKit:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

    def reset(self) -> None:
        """Begin a race: laps, collisions and encoders begin at zero."""
        self.collisions, self.reset_asked = 0, False
        self._answer: Answer | None = None  # that acts
        self._answers_due: deque[tuple[float, Answer]] = deque()  # and those to come, with the time of each [s]
        self._asked, self._frame = 0.0, -math.inf  # [s] of the last packet, and when the next one is due
        self._laps: LapTimer | None = None
        self._encoders, self._stamp = np.zeros(2), math.nan
        self._sent: float | None = None  # [s] on the wall's clock, of a packet that is not answered
        self._began: float | None = None  # [s] on the wall's clock, when the simulated time was 0

    def look_round(self, surroundings: Surroundings) -> None:
        """Take the world, whose laps are timed and whose pictures are taken."""
        self._surroundings = surroundings
        if self._laps is None:
            self._laps = LapTimer(surroundings.world.track)

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Tell the DevKit what the car senses, and return its command; ControllerError: it is silent; MessageError."""
        self._turn_wheels(odometry)
        try:
            if self._real_time:
                self._keep_time(odometry.stamp)
            late = self._hear(0.0)
            if self._answers:
                self._extra += late
            while self._answers_due and self._answers_due[0][0] <= odometry.stamp + _SAME_TIME:
                self._answer = self._answers_due.popleft()[1]
            if self._sent is None and odometry.stamp >= self._frame - _SAME_TIME:
                self._frame = odometry.stamp + 1.0 / RATE
                self._ask(scan, odometry)
            if self._is_silent() and not (self._heard or self._classic) and self._client.is_alive():
                self._classic = True
                warnings.warn(
                    f"the DevKit at {self.address} has not answered the first packet: from now on it is sent those of "
                    "classic DevKits, with ticks of the encoders, intensities, and ranges as text", stacklevel=2,
                )  # fmt: skip
                self._ask(scan, odometry)
        except EngineError as error:
            raise ControllerError(f"the DevKit has gone: {error}") from None
        if self._is_silent():
            raise ControllerError(f"the DevKit at {self.address} {self._why_silent()}")
        return STOP if self._answer is None else self._answer.command

    def _ask(self, scan: LaserScan, odometry: Odometry) -> None:
        """Send a packet, and in lockstep wait for its answer; the simulator's acceleration has no gravity."""
        gravity = self._surroundings.world.parameters.gravity * np.array(self._surroundings.up)
        moved = replace(odometry, linear_acceleration=odometry.linear_acceleration - gravity)
        self._asked = odometry.stamp
        throttle = 0.0 if self._answer is None else self._answer.throttle
        told = packet(
            scan, moved, throttle=throttle, encoders=self._encoders, laps=self._lap_times(odometry),
            collisions=self.collisions, image=self._camera(self._surroundings, odometry), classic=self._classic,
        )  # fmt: skip
        self._client.send(told)
        self._sent = time.monotonic()
        if self._real_time:
            return
        came = self._hear(self._patience)
        until = time.monotonic() + _SETTLE
        while 0 < came < (self._answers or math.inf) and time.monotonic() < until:
            came += self._hear(until - time.monotonic())  # how many answers there are is seen after the first packet
        self._answers = self._answers or came
        self._extra = max(self._extra + came - self._answers - _FORGOTTEN, 0.0)
        if self._extra > _MOST_EXTRA:
            said = f"the DevKit at {self.address} sends several answers to a packet, more than {_SETTLE:g} s apart"
            raise ControllerError(f"{said}; accepted: one answer to each packet, or --real-time")

    def _hear(self, timeout: float) -> int:
        """Take the answers that have come, of which the newest will act; wait for one if there is none."""
        try:
            answers = self._client.receive(timeout)
        except TimeoutError:
            return 0
        for data in answers:
            answer, acts = read_answer(data), self._asked + LATE / RATE
            while self._answers_due and self._answers_due[-1][0] >= acts:
                self._answers_due.pop()
            self._answers_due.append((acts, answer))
            self.reset_asked = self.reset_asked or (answer.reset and not self._reset_held)
            self._reset_held = answer.reset
        self._heard = self._heard or self._sent is not None
        self._sent = None
        return len(answers)

    def _is_silent(self) -> bool:
        return self._sent is not None and time.monotonic() - self._sent >= self._patience

    def _why_silent(self) -> str:
        if not self._client.is_alive():
            return f"has not answered within {self._patience:g} s, nor does its connection answer a ping"
        tried = "" if self._heard else ", neither to the packets of the league nor to those of classic DevKits"
        return (
            f"has sent no answer for {self._patience:g} s{tried}; its connection is alive: an exception has ended its "
            f"handler of {EVENT!r}, which its own terminal shows, or it takes longer than --patience"
        )

    def _keep_time(self, stamp: float) -> None:
        """Wait until as much time has passed as was simulated."""
        now = time.monotonic()
        if self._began is None:
            self._began = now - stamp
        time.sleep(max(self._began + stamp - now, 0.0))

    def _turn_wheels(self, odometry: Odometry) -> None:
        """Turn the encoders by what the rear wheels have rolled since the last tick."""
        passed = 0.0 if math.isnan(self._stamp) else odometry.stamp - self._stamp
        self._encoders = self._encoders + odometry.wheel_speeds[_REAR] * passed / WHEEL_RADIUS
        self._stamp = odometry.stamp

    def _lap_times(self, odometry: Odometry) -> LapTimes:
        assert self._laps is not None
        x, y, _ = self._surroundings.pose
        count, times = self._laps.update(odometry.stamp, (x, y)), self._laps.lap_times
        if not count:
            return LapTimes(count=0, time=odometry.stamp, last=0.0, best=0.0)
        return LapTimes(count=count, time=odometry.stamp - sum(times), last=times[-1], best=min(times))


def split_address(address: str) -> tuple[str, int]:
    """Return host and port of a text such as "127.0.0.1:4567"; without a port, PORT.

    Raises SettingsError: it is no such text.
    """
    host, colon, port = address.rpartition(":")
    if not colon:
        host, port = address, str(PORT)
    if not host or not port.isdecimal() or not 1 <= int(port) <= 65535:
        raise SettingsError(f"devkit is {address!r}; accepted: HOST or HOST:PORT, such as 127.0.0.1:{PORT}")
    return host, int(port)


class BlankCamera:
    """A camera whose pictures are white."""

    def __init__(self) -> None:
        width, height = _BLANK_SIZE
        self._picture = jpeg(np.full((height, width, 3), 255, np.uint8))

    def __call__(self, surroundings: Surroundings, odometry: Odometry) -> str:
        """See Camera."""
        return self._picture


class FrontCamera:
    """A camera that draws what is ahead of the car, and other cars with it. The extra `render` draws."""

    def __init__(self) -> None:
        self._camera = front_camera.FrontCamera()

    def __call__(self, surroundings: Surroundings, odometry: Odometry) -> str:
        """See Camera."""
        return jpeg(self._camera.picture(surroundings))


def jpeg(pixels: NDArray[np.uint8]) -> str:
    """Return a picture (height, width, 3) as a JPEG in base64; MissingExtraError: pillow is not installed."""
    try:
        from PIL import Image
    except ImportError as error:
        raise missing_extra("pictures of the front camera need pillow", "autodrive") from error
    written = io.BytesIO()
    Image.fromarray(pixels).save(written, format="JPEG", quality=_QUALITY)
    return base64.b64encode(written.getvalue()).decode("ascii")
