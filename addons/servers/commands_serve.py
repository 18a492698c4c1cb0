"""The commands `fg-mujoco serve`: races that DevKits of AutoDRIVE drive, and live ones for Foxglove and rosbridge."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from fg_mujoco.cli.config import add_config
from fg_mujoco.cli.options import CAR, add_setup_options, add_trust_option, number, setup_of, whole
from fg_mujoco.cli.out import RUN, add_out_options
from fg_mujoco.cli.race import RaceWatch, check_out, race_table
from fg_mujoco.errors import ControllerError
from fg_mujoco.messages import STOP

if TYPE_CHECKING:
    from fg_mujoco.racing.race import RaceProgress
    from fg_mujoco.racing.result import RaceResult
    from fg_mujoco.racing.setup import Setup

    from .autodrive.devkit import DevKit

_DONE, _NOT_DONE = 0, 1
_RULES = "autodrive_2026"
_MOST_RACES = 100  # that resets of a DevKit begin


def add_serve(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the commands; `add_command` is the one that adds the others."""
    text = "race a car that another program drives or watches: Foxglove, roslibpy or roslibjs, an AutoDRIVE DevKit"
    served = commands.add_parser("serve", help=text, description=text, allow_abbrev=False)
    served = served.add_subparsers(title="commands", metavar="COMMAND", required=True)
    text = "connect to a DevKit of AutoDRIVE, in the place of its simulator, and race the car that it drives"
    command = add_command(served, "autodrive", _autodrive, text)
    add = command.add_argument
    add(
        "--devkit", action="append", metavar="HOST[:PORT]",
        help="where a DevKit listens, which is to be started first; again for each car; default: 127.0.0.1:4567",
    )  # fmt: skip
    add(
        "--real-time", action="store_true",
        help="a tick takes 25 ms and holds the last command; default: it waits for the DevKit's answer",
    )  # fmt: skip
    add(
        "--patience", type=number, metavar="S",
        help="time after which a DevKit that does not answer is taken to be gone; default: 10",
    )  # fmt: skip
    add("--camera", action="store_true", help="draw the pictures of the front camera; default: they are blank")
    add_setup_options(
        command, "track", "laps", "obstacles", "obstacle_seed", "moving", "patches", *CAR, "lidar", "motion_distortion",
        "seed", "opponents", "grid", "rules", "time_limit",
        rules=f"of race control; default: {_RULES}, as the league has them",
    )  # fmt: skip
    add_out_options(command, RUN, "write a run folder here; where the DevKit resets, folders 1, 2, ... in it")
    add_config(command)
    add_trust_option(add)

    text = "serve a live race to Foxglove, which shows it, and may drive and change the car"
    _add_live_options(add_command(served, "foxglove", _foxglove, text), port=8765)
    text = "serve a live race to programs of roslibpy or roslibjs, which drive the car as on a robot, without ROS"
    driver = "planner that drives until a program does, as in race; default: the car stands until then"
    _add_live_options(add_command(served, "rosbridge", _rosbridge, text), port=9090, controller=driver)


def _add_live_options(command: argparse.ArgumentParser, port: int, **texts: str) -> None:
    """Add the options of a live race; `texts` are the help of some of them."""
    add = command.add_argument
    add_setup_options(command, "track", "controller", **texts)
    add("--host", metavar="ADDRESS", help="address to listen on; 0.0.0.0: all; default: 127.0.0.1, this machine alone")
    add("--port", type=whole, metavar="N", help=f"to listen on; default: {port}")
    add(
        "--step-on-drive", action="store_true",
        help="time stands still between commands, and each one on /drive is a tick of 25 ms; default: real time",
    )  # fmt: skip
    add_setup_options(command, *CAR, "seed", "opponents", "grid", "obstacles", "obstacle_seed", "moving", "patches")
    add_config(command)
    add_trust_option(add)


def _foxglove(options: argparse.Namespace) -> int:
    from fg_mujoco.addons.look.live.live_session import LiveSession

    from .foxglove_server import HOST, PORT, FoxgloveServer, require_foxglove

    require_foxglove()
    host, port = options.host or HOST, PORT if options.port is None else options.port
    session = LiveSession(setup_of(options))
    with FoxgloveServer(session, host=host, port=port, step_on_drive=options.step_on_drive, log=_log) as server:
        try:
            print(f"{server.url}, in Foxglove: Open connection; Ctrl-C ends it", flush=True)
            server.run()
        except KeyboardInterrupt:
            print(file=sys.stderr)
    return _DONE


def _rosbridge(options: argparse.Namespace) -> int:
    from fg_mujoco.addons.look.live.live_session import LiveSession

    from .rosbridge.network import require_rosbridge
    from .rosbridge.server import HOST, PORT, RosbridgeServer

    require_rosbridge()
    host, port = options.host or HOST, PORT if options.port is None else options.port
    session = LiveSession(setup_of(options))
    if not hasattr(options, "controller") and getattr(options, "setup", None) is None:
        session.hold(STOP)

    with RosbridgeServer(session, host=host, port=port, step_on_drive=options.step_on_drive, log=_log) as server:
        try:
            print(f"{server.url}, for roslibpy and roslibjs; Ctrl-C ends it", flush=True)
            server.run()
        except KeyboardInterrupt:
            print(file=sys.stderr)
    return _DONE


def _log(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _autodrive(options: argparse.Namespace) -> int:
    from .autodrive.devkit import PATIENCE, PORT, DevKit
    from .autodrive.front_camera import BlankCamera, FrontCamera

    if not hasattr(options, "rules"):
        options.rules = _RULES
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
    from fg_mujoco.cli.out import write_page
    from fg_mujoco.pictures.plots import write_run

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
    return _DONE if result.car.finished else _NOT_DONE


def _race_once(setup: Setup, devkits: Sequence[DevKit]) -> RaceResult:
    from fg_mujoco.racing.race import race_setup

    with contextlib.redirect_stdout(sys.stderr), RaceWatch(show=True) as shown:

        def watch(progress: RaceProgress) -> None:
            for devkit, collisions in zip(devkits, progress.wall_contacts, strict=False):
                devkit.collisions = collisions
            if any(devkit.reset_asked for devkit in devkits):
                raise KeyboardInterrupt  # ends the race between two ticks
            shown(progress)

        return race_setup(setup, watch=watch)
