"""The commands `fg-mujoco serve`: races that DevKits of AutoDRIVE drive; live ones for Foxglove and ROS 2."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from fg_mujoco.cli.command import CONFIG, Commands, Part, command, number, option, whole
from fg_mujoco.cli.options import setup_of, setup_options
from fg_mujoco.cli.out import RUN, out_options, write_page
from fg_mujoco.cli.race import RaceWatch, check_out, race_table
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.messages import STOP
from fg_mujoco.pictures.plots import write_run
from fg_mujoco.racing.race import race_setup

if TYPE_CHECKING:
    from fg_mujoco.addons.look.live.live_session import LiveSession
    from fg_mujoco.racing.race import RaceProgress
    from fg_mujoco.racing.result import RaceResult
    from fg_mujoco.racing.setup import Setup

    from .autodrive.devkit import DevKit

_RULES, _VEHICLE = "autodrive_2026", "autodrive"
_MOST_RACES = 100  # that resets of a DevKit begin


def _race_options(**helps: str) -> tuple[Part, ...]:
    """Return the options of a live race."""
    return (
        setup_options(but=("laps", "lidar", "motion_distortion", "rules", "time_limit", "decision_limit"), **helps),
        option(
            "--step-on-drive",
            "time stands still between commands, and each one on /drive is a tick of 25 ms; default: real time",
        ),
        CONFIG,
    )


def _serve(session: LiveSession, server: Any, options: argparse.Namespace, said: str, **own: Any) -> int:
    """Serve a live race until Ctrl-C; `said` follows the address."""
    with server(session, step_on_drive=options.step_on_drive, log=_log, **own) as served:
        try:
            print(f"{served.url}, {said}; Ctrl-C ends it", flush=True)
            served.run()
        except KeyboardInterrupt:
            print(file=sys.stderr)
    return 0


def _driven_from_outside(options: argparse.Namespace) -> LiveSession:
    """Return a session whose car stands until a program drives it, unless a planner is asked for."""
    from fg_mujoco.addons.look.live.live_session import LiveSession

    session = LiveSession(setup_of(options))
    if not hasattr(options, "controller") and getattr(options, "setup", None) is None:
        session.hold(STOP)
    return session


@command(
    *_race_options(),
    option("--host", "address to listen on; 0.0.0.0: all; default: 127.0.0.1, this machine alone", "ADDRESS"),
    option("--port", "to listen on; default: 8765", "N", whole, 8765),
)
def _foxglove(options: argparse.Namespace) -> int:
    """Serve a live race to Foxglove, which shows it, and may drive and change the car."""
    from fg_mujoco.addons.look.live.live_session import LiveSession

    from .foxglove_server import FoxgloveServer, require_foxglove

    require_foxglove()
    own = {"host": options.host or "127.0.0.1", "port": options.port}
    return _serve(LiveSession(setup_of(options)), FoxgloveServer, options, "in Foxglove: Open connection", **own)


_DRIVER = "planner that drives until a program does, as in race; default: the car stands until then"


@command(
    *_race_options(controller=_DRIVER),
    option("--domain", "of DDS, 0 to 232; default: that of ROS_DOMAIN_ID, else 0", "N", whole),
    option("--namespace", "of the node and its topics, such as /car_1; default: none", "NAME", default="/"),
    option(
        "--host", "address of the network interface to be seen on; default: 127.0.0.1, this machine alone", "ADDRESS"
    ),
    option(
        "--peer", "machine to look for nodes on, where there is no multicast; again for each", "ADDRESS",
        action="append",
    ),
    option(
        "--type", "type of commands on a topic, such as /drive=ackermann_msgs/msg/AckermannDrive; again for each",
        "TOPIC=TYPE", action="append",
    ),
    option("--distribution", "of the nodes' ROS 2: foxy to lyrical; default: humble", "NAME", default="humble"),
)  # fmt: skip
def _ros2(options: argparse.Namespace) -> int:
    """Serve a live race as a node of ROS 2 on DDS: nodes of a ROS 2 on this machine or others drive the car."""
    from .ros2.participant import require_cyclonedds
    from .ros2.server import Ros2Server, types_in

    require_cyclonedds()
    if options.step_on_drive and hasattr(options, "controller"):
        raise SettingsError("--controller drives until a command comes, --step-on-drive never; accepted: one of them")
    alone = options.host is None and not options.peer and "CYCLONEDDS_URI" not in os.environ
    on = " on this machine alone, though its UDP sockets are open on all addresses" if alone else ""
    return _serve(
        _driven_from_outside(options), Ros2Server, options, f"for nodes of ROS 2{on}",
        types=types_in(options.type or ()), namespace=options.namespace, domain=options.domain, host=options.host,
        peers=options.peer or (), distribution=options.distribution,
    )  # fmt: skip


def _log(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


@command(
    option(
        "--devkit", "address of a running DevKit; again for each car; default: "
        "127.0.0.1:4567", "HOST[:PORT]", action="append",
    ),
    option(
        "--real-time", "a tick takes 25 ms and holds the last command; default: each packet waits for its answer"
    ),
    option(
        "--patience", "time without an answer after which the DevKit counts as gone [s]; default: 10", "S", number
    ),
    option("--camera", "draw the pictures of the front camera; default: they are blank"),
    setup_options(
        but=("controller", "decision_limit"),
        rules=f"of race control: {{names}}; default: {_RULES}, as the league has them",
        vehicle=f"{{names}}, or a file or folder of one; default: {_VEHICLE}, the league's",
    ),
    out_options(RUN, "write a run folder here; where the DevKit resets, folders 1, 2, ... in it"),
    CONFIG,
)  # fmt: skip
def _autodrive(options: argparse.Namespace) -> int:
    """Connect to a DevKit of AutoDRIVE, in the place of its simulator, and race the car that it drives."""
    from .autodrive.devkit import PATIENCE, PORT, BlankCamera, DevKit, FrontCamera

    if not hasattr(options, "rules"):
        options.rules = _RULES
    if not hasattr(options, "vehicle") and getattr(options, "setup", None) is None:
        options.vehicle = _VEHICLE
    setup = setup_of(options)
    picture = options.out is not None and check_out(options.out)
    patience = PATIENCE if options.patience is None else options.patience
    with contextlib.ExitStack() as stack:
        devkits = []
        for address in options.devkit or [f"127.0.0.1:{PORT}"]:
            camera = FrontCamera() if options.camera else BlankCamera()
            devkit = DevKit(address, camera, real_time=options.real_time, patience=patience)
            devkits.append(stack.enter_context(devkit))
        return _race_on(_with_devkits(setup, devkits), devkits, options.out, picture)


def _with_devkits(setup: Setup, devkits: Sequence[DevKit]) -> Setup:
    """Return a setup in which DevKits drive the first cars, all in the car of the first; opponents follow."""
    first, *others = setup.entries
    cars = [replace(first, controller=devkit, name=f"devkit_{i}") for i, devkit in enumerate(devkits)]
    return setup.replace(entries=[*cars, *others])


def _race_on(setup: Setup, devkits: Sequence[DevKit], out: str | None, picture: bool) -> int:
    """Race, and once more whenever a DevKit asks for the simulation to begin anew."""
    number, again = 0, True
    while again:
        number, result = number + 1, _race_once(setup, devkits)
        again = any(devkit.reset_asked for devkit in devkits)
        folder = None if out is None else f"{out}/{number}" if again or number > 1 else out
        if folder is not None:
            write_run(result, folder, picture=picture, add=write_page)
        print(race_table(result, folder), flush=True)
        if again and number == _MOST_RACES:
            raise ControllerError(f"a DevKit has asked for a reset {number} times; accepted: fewer in one command")
    return 0 if result.car.finished else 1


def _race_once(setup: Setup, devkits: Sequence[DevKit]) -> RaceResult:
    with contextlib.redirect_stdout(sys.stderr), RaceWatch(show=True) as shown:

        def watch(progress: RaceProgress) -> None:
            for devkit, collisions in zip(devkits, progress.wall_contacts, strict=False):
                devkit.collisions = collisions
            if any(devkit.reset_asked for devkit in devkits):
                raise KeyboardInterrupt  # ends the race between two ticks
            shown(progress)

        return race_setup(setup, watch=watch, each_tick=True)


SERVE = Commands(
    "race a car that another program drives or watches: ROS 2, Foxglove, an AutoDRIVE DevKit",
    {"autodrive": _autodrive, "foxglove": _foxglove, "ros2": _ros2},
)
