"""A live race in MuJoCo's own viewer, in a window on the desktop."""

from __future__ import annotations

import sys
import time

from fg_mujoco.errors import FgMujocoError, SettingsError
from fg_mujoco.pictures.display_check import can_open_window
from fg_mujoco.simulation.settings import friction_text

from .hand_driver import KEYS
from .live_session import LiveSession

_ARROWS = {265: "faster", 264: "slower", 263: "left", 262: "right"}  # GLFW's codes of the keys
_NO_DISPLAY = "no display here; accepted: --web, which serves the view to a browser"


def require_display() -> None:
    """Make sure that a window can be opened; SettingsError: there is no display."""
    if not can_open_window():
        raise SettingsError(_NO_DISPLAY)


def run_desktop(session: LiveSession) -> None:
    """Show a session in a window, and drive it on in real time, until the window is closed.

    What happens, such as a lap, a crash or a planner that fails, is printed on stderr; first the friction of
    the tires and the one that the planner assumes.

    Keys: P pause, R reset, M planner or keys, and those of hand_driver.KEYS, or the arrows.
    Raises SettingsError: there is no display, or it cannot be used.
    """
    require_display()
    import mujoco.viewer

    actions = {ord(key): name for name, key in KEYS.items()} | _ARROWS

    def on_key(code: int) -> None:
        if code == ord("P"):
            session.paused = not session.paused
        elif code == ord("R"):
            session.reset()
        elif code == ord("M"):
            session.by_hand = not session.by_hand
        elif code in actions:
            session.key(actions[code])

    try:
        viewer = mujoco.viewer.launch_passive(session.world.model, session.simulation.data, key_callback=on_key)
    except FgMujocoError:
        raise
    except Exception as error:  # whatever a window system says
        raise SettingsError(f"the display cannot be used: {' '.join(str(error).split())}; accepted: --web") from error
    print(friction_text(session.world.car.mu, session.settings.assumed_mu), file=sys.stderr)
    with viewer:
        due, printed = time.perf_counter(), ""
        while viewer.is_running():
            with viewer.lock():
                session.tick()
            if session.message != printed:
                printed = session.message
                print(printed or "the race goes on", file=sys.stderr)
                if session.failure is not None:
                    print(session.failure.traceback, end="", file=sys.stderr)
            viewer.sync()
            due = max(due + session.period, time.perf_counter() - 4.0 * session.period)
            time.sleep(max(0.0, due - time.perf_counter()))
