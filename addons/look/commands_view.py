"""The command `fg-mujoco view`: a race to be watched as it goes, in a window or, with --web, in a browser."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

from fg_mujoco.cli.config import add_config
from fg_mujoco.cli.options import CAR, add_setup_options, add_trust_option, setup_of, whole

_DONE = 0


def add_view(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "watch a race as it goes, turn its knobs, and drive by keys"
    command = add_command(commands, "view", _view, text)
    add = command.add_argument
    add_setup_options(
        command, "track", "controller", *CAR, "seed", "opponents", "grid", "obstacles", "obstacle_seed", "moving",
        "patches",
    )  # fmt: skip
    add("--web", action="store_true", help="serve the view to a browser; without it, a window is opened")
    add("--host", metavar="ADDRESS", help="with --web: listen there; default: 127.0.0.1, this machine alone")
    add("--port", type=whole, metavar="N", help="with --web; default: 8080")
    add("--no-wait", action="store_true", help="with --web: start at once, and not when the first browser has come")
    add_config(command)
    add_trust_option(add)


def _view(options: argparse.Namespace) -> int:
    from fg_mujoco.errors import SettingsError

    from .live.browser import HOST, PORT, LiveView, check_port, require_viser
    from .live.desktop import require_display, run_desktop
    from .live.live_session import LiveSession

    setup = setup_of(options)
    host, port = options.host or HOST, PORT if options.port is None else options.port
    if options.web:
        require_viser()
        check_port(host, port)  # before the world is built
    elif options.host is not None or options.port is not None or options.no_wait:
        raise SettingsError("--host, --port and --no-wait are of a browser; accepted: with --web")
    else:
        require_display()
    session = LiveSession(setup)
    if not options.web:
        run_desktop(session)
        return _DONE
    with LiveView(session, host=host, port=port) as view:
        try:
            waits = "" if options.no_wait else "; the race starts when a browser opens it (--no-wait: at once)"
            print(f"{view.url}{waits}; Ctrl-C ends it", flush=True)
            view.run(wait=not options.no_wait)
        except KeyboardInterrupt:
            print(file=sys.stderr)
    return _DONE
