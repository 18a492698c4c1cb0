"""A live race in a browser: the world, what the LiDAR sees, where the planner is heading; knobs, and keys to drive by.

The server is viser's. It listens on 127.0.0.1 unless another address is given: whoever reaches it can turn the knobs,
but for the pages of other sites in a browser (`handshake`).
"""

from __future__ import annotations

import contextlib
import html
import importlib.util
import io
import math
import socket
import threading
import time
import typing
import warnings
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from fg_mujoco.errors import EngineError, SettingsError, missing_extra
from fg_mujoco.simulation.planner_failure import one_line
from fg_mujoco.simulation.settings import friction_text
from fg_mujoco.vehicle.tire_slip import sliding_text

from ..intermediate_values import NUMBER, SHOWS_NOTHING
from .browser_scene import CAMERAS, LEGEND, LiveScene, camera_view
from .hand_driver import ARROWS, KEYS, WASD
from .handshake import own_pages_only
from .live_session import LiveSession

HOST, PORT = "127.0.0.1", 8080

_GREATEST_MU = 1.5  # of the sliders
_FRAME = 1.0 / 25.0  # [s] of wall time between two pictures
_SLOW_FRAME = 0.1  # [s] between two looks at the texts and the trace
_PLOT_FRAME = 0.25  # [s] between two looks at the plots
_PLOT_STEP = 2  # every other tick is a point of the plots
_PLOT_HEIGHT = 150  # [px]
_MARKUP = frozenset("\\`*_{}[]()<>#+-.!|&~$")  # letters that mean something in Markdown, HTML or formulas
_SPEED, _COMMAND, _LAP = "#2f7ed8", "#8a8f98", "#e07b00"


def require_viser() -> None:
    """Make sure that a browser can be served; MissingExtraError, with what installs viser."""
    if importlib.util.find_spec("viser") is None:
        raise missing_extra("the live view in a browser needs viser", "live")


def check_port(host: str, port: int) -> None:
    """Refuse an address that cannot be listened on; SettingsError: in use, not of this machine, or without rights."""
    if not 1 <= port <= 65535:
        raise SettingsError(f"port is {port}; accepted: 1 to 65535")
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        raise SettingsError(
            f"{host}:{port} cannot be listened on: {error.strerror or error}; accepted: an address of this machine "
            "and a port that is free, by --port"
        ) from error


class LiveView:
    """Serves a session to browsers, at `url`.

    Raises MissingExtraError: viser is not installed; SettingsError: an address that cannot be listened on; EngineError:
    a version of viser whose server cannot be guarded against pages of other sites.
    """

    def __init__(self, session: LiveSession, *, host: str = HOST, port: int = PORT) -> None:
        require_viser()
        check_port(host, port)
        import viser

        self.session = session
        with own_pages_only(host) as guarded, contextlib.redirect_stdout(io.StringIO()):  # its banner
            self._server = viser.ViserServer(host=host, port=port, label="fg_mujoco", verbose=False)
        if not guarded:
            self._server.stop()
            raise EngineError("this version of viser starts its server in an unknown way; accepted: viser 1.x")
        if self._server.get_port() != port:  # somebody was faster
            self._server.stop()
            raise SettingsError(f"{host}:{port} is in use; accepted: a port that is free, by --port")
        self.url = f"http://{'localhost' if host in ('127.0.0.1', '0.0.0.0', '::1', '::') else host}:{port}"
        self._stop, self._met = threading.Event(), threading.Event()
        self._rate = 1.0  # of simulated to wall time
        self._colours = dict(LEGEND)  # with the values that the planner has shown
        with self._server.atomic():
            self._scene = LiveScene(self._server.scene, session)
            self._build_knobs()
        self._server.on_client_connect(self._aim)
        self._server.on_client_connect(lambda _: self._met.set())
        self.show()

    def __enter__(self) -> LiveView:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """End `run`, and stop serving."""
        self._stop.set()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def run(self, *, wait: bool = False) -> None:
        """Drive on in real time, or at the knob's rate, until `close` or Ctrl-C; `wait` for the first browser."""
        while wait and not self._met.wait(_SLOW_FRAME) and not self._stop.is_set():
            pass
        due = shown = texts = plots = time.perf_counter()
        while not self._stop.is_set():
            self.session.tick()
            due += self.session.period / self._rate
            now = time.perf_counter()
            if now - shown >= _FRAME:
                self._draw(self.show)
                shown = now
            if now - texts >= _SLOW_FRAME:
                self._draw(self._show_texts, self._scene.show_trace)
                texts = now
            if now - plots >= _PLOT_FRAME:
                self._draw(self._show_plots)
                plots = now
            due = max(due, now - 4.0 * self.session.period)  # what could not be caught up with is let go
            self._stop.wait(max(0.0, due - time.perf_counter()))

    def show(self) -> None:
        """Show the session as it is now."""
        with self._server.atomic():
            self._scene.show()
            for client in self._server.get_clients().values():
                self._aim(client)

    def _draw(self, *parts: Callable[[], None]) -> None:
        """Draw parts of the page. If viser fails, as it may when a page closes, the race goes on without them."""
        try:
            for part in parts:
                part()
        except Exception as error:  # viser wakes its thread's asyncio events from this one
            warnings.warn(f"the live view left out a picture: {one_line(error)}", stacklevel=2)

    def _build_knobs(self) -> None:
        gui, session = self._server.gui, self.session
        gui.configure_theme(show_logo=False, show_share_button=False)  # which would go through a server elsewhere
        self._status = gui.add_markdown("")
        self._build_plots()
        self._pause = gui.add_button("pause", hint="key P")
        self._pause.on_click(lambda _: self._toggle_pause())
        reset = gui.add_button("reset", hint="key R: back to the start")
        reset.on_click(lambda _: session.reset())
        self._driver = gui.add_dropdown("driver", ("planner", "keys"), initial_value="planner", hint="key M")
        self._driver.on_update(lambda event: setattr(session, "by_hand", event.target.value == "keys"))
        self._camera = gui.add_dropdown("camera", CAMERAS, initial_value="chase")
        with gui.add_folder("race"):
            self._slider(
                "speed limit", "max_speed", session.settings.max_speed, (0.5, session.world.parameters.max_speed, 0.1)
            )
            self._slider("tires' mu", "mu", round(session.world.car.mu, 4), (0.1, _GREATEST_MU, 0.01))
            self._planner_mu = self._slider("planner's mu", "planner_mu", self._assumed_mu, (0.1, _GREATEST_MU, 0.01))
            rate = gui.add_slider("time rate", 0.1, 4.0, 0.1, 1.0)
            rate.on_update(lambda event: setattr(self, "_rate", float(event.target.value)))
        with gui.add_folder("colours"):
            self._legend = gui.add_html(_legend(self._colours))
        with gui.add_folder("drive by keys"):
            gui.add_html(_key_help())
            for names in (("left", "faster", "right"), ("slower", "stop")):
                group = gui.add_button_group("", names)
                group.on_click(lambda event: self._press(event.target.value))
        defaults = session.planner_defaults
        if defaults is not None:
            with gui.add_folder(f"planner: {session.setup.first.controller}", expand_by_default=False):
                self._planner_knobs(defaults)
        self._hotkey("pause or go on", "P", self._toggle_pause)
        self._hotkey("reset", "R", session.reset)
        self._hotkey("planner or keys", "M", self._toggle_driver)
        for keys in (KEYS, ARROWS, WASD):
            for name, key in keys.items():
                self._hotkey(f"{name} ({_shown(key)})", key, lambda name=name: self._press(name))

    def _build_plots(self) -> None:
        from viser import uplot

        gui = self._server.gui
        self._values = gui.add_markdown(_SHOWS_NOTHING)
        time = uplot.Series(label="t [s]")
        self._speed_plot = gui.add_uplot(
            self._speeds(), (time, uplot.Series(label="speed [m/s]", stroke=_SPEED, width=2),
                             uplot.Series(label="commanded", stroke=_COMMAND, width=1)),
            scales={"x": uplot.Scale(time=False)}, height=_PLOT_HEIGHT,
        )  # fmt: skip
        self._lap_plot = gui.add_uplot(
            (np.zeros(1), np.zeros(1)),
            (uplot.Series(label="lap"),
             uplot.Series(label="lap time [s]", stroke=_LAP, width=2, points=uplot.Series_Points(show=True))),
            scales={"x": uplot.Scale(time=False)}, height=_PLOT_HEIGHT, visible=False,
        )  # fmt: skip

    def _speeds(self) -> tuple[Any, ...]:
        """Return time [s], speed [m/s] and commanded speed [m/s] as the plot takes them."""
        found = self.session.history[::-_PLOT_STEP][::-1]
        return tuple(np.ascontiguousarray(column) for column in (found if len(found) else np.zeros((1, 3))).T)

    def _show_plots(self) -> None:
        """Draw speed over time, and once there are laps, their times."""
        self._speed_plot.data = self._speeds()
        times = self.session.laps.lap_times
        if len(times) != (len(self._lap_plot.data[0]) if self._lap_plot.visible else 0):
            self._lap_plot.visible = bool(times)
            if times:
                self._lap_plot.data = np.arange(1.0, len(times) + 1.0), np.array(times)

    def _planner_knobs(self, defaults: Any) -> None:
        """Add a knob for each of the planner's settings, by its kind."""
        gui, session = self._server.gui, self.session
        kinds = typing.get_type_hints(type(defaults))
        for field in fields(defaults):
            name, value = field.name, session.planner_settings.get(field.name, getattr(defaults, field.name))
            label, words = name.replace("_", " "), typing.get_args(kinds[name])
            if isinstance(value, bool):
                knob = gui.add_checkbox(label, value)
            elif isinstance(value, (int, float)):
                top = 2.0 * value if value > 0.0 else 1.0
                knob = gui.add_slider(label, 0.0, top, top / 200.0, float(value))
            elif words and all(isinstance(word, str) for word in words):
                knob = gui.add_dropdown(label, words, initial_value=value)
            else:
                continue
            whole = isinstance(value, int) and not isinstance(value, bool)
            knob.on_update(
                lambda event, name=name, whole=whole: session.change(
                    f"planner.{name}", round(event.target.value) if whole else event.target.value
                )
            )

    def _slider(self, label: str, name: str, value: float, span: tuple[float, float, float]) -> Any:
        least, greatest, step = span
        knob = self._server.gui.add_slider(label, min(least, value), max(greatest, value), step, value)
        knob.on_update(lambda event: self._turned(name, event))
        return knob

    def _turned(self, name: str, event: Any) -> None:
        """Ask the session for what a browser has set a slider to, and not for what is shown on it from here."""
        if event.client is not None:
            self.session.change(name, float(event.target.value))

    @property
    def _assumed_mu(self) -> float:
        """Position of the slider of the planner's friction coefficient: without friction limits at its greatest."""
        return round(min(self.session.settings.assumed_mu, _GREATEST_MU), 4)

    def _hotkey(self, label: str, key: Any, act: Any) -> None:
        self._server.gui.add_command(label, hotkey=key).on_trigger(lambda _: act())

    def _toggle_pause(self) -> None:
        self.session.paused = not self.session.paused
        self._label_pause()

    def _label_pause(self) -> None:
        """Let the button say what it does: a planner that fails pauses, too."""
        label = "go on" if self.session.paused else "pause"
        if self._pause.label != label:
            self._pause.label = label

    def _toggle_driver(self) -> None:
        self._driver.value = "planner" if self.session.by_hand else "keys"

    def _press(self, name: str) -> None:
        self.session.key(name)
        if self._driver.value != "keys":
            self._driver.value = "keys"

    def _show_texts(self) -> None:
        session = self.session
        limit = session.limit_speed
        best = f", best lap {min(session.laps.lap_times):.3f} s" if session.laps.lap_times else ""
        self._label_pause()
        if session.settings.planner_mu is None:  # the planner knows the tires' mu
            self._planner_mu.value = self._assumed_mu
        parts = ("paused" if session.paused else "", "a tire slides" if session.slides else "", session.message)
        state = "\n\n".join(_plain(text) for text in parts if text)
        if session.failure is not None and session.failure.traceback:
            state += f"\n\n```\n{session.failure.traceback}```"
        state = state or ("" if math.isnan(session.sliding_speed) else "no tire slides")
        self._status.content = (
            f"**{session.simulation.speed:.2f} m/s** at t = {session.simulation.time:.2f} s\n\n"
            f"limit {'none' if limit > 99.0 else f'{limit:.2f} m/s'}, "
            f"friction utilisation {session.friction_utilisation:.2f}, "
            f"sliding {sliding_text(session.sliding_speed, 3)}\n\n"
            f"{friction_text(session.world.car.mu, session.settings.assumed_mu)}\n\n"
            f"lap {session.laps.laps_completed + 1}{best}\n\n{state}"
        )
        numbers = {name: value for name, value in session.values.now.items() if value.kind == NUMBER}
        drawn = {each.name: each.colour for each in session.drawings() if each.name}
        if drawn.keys() - self._colours.keys():
            self._colours |= drawn
            self._legend.content = _legend(self._colours)
        if numbers:
            rows = "\n".join(f"| {_plain(name)} | {float(value.array):.4g} |" for name, value in numbers.items())
            self._values.content = f"| the planner shows | |\n| --- | --- |\n{rows}"
        silent = self._values.content == _SHOWS_NOTHING and len(self._colours) == len(LEGEND)
        self._values.visible = bool(numbers) or silent

    def _aim(self, client: Any) -> None:
        view = camera_view(self.session, self._camera.value)
        if view is not None:
            client.camera.position, client.camera.look_at = view


def _plain(text: str) -> str:
    """Return a text that Markdown takes as it is, in a table."""
    return "".join(f"&#{ord(letter)};" if letter in _MARKUP else letter for letter in " ".join(text.split()))


_SHOWS_NOTHING = _plain(SHOWS_NOTHING)


def _legend(colours: dict[str, tuple[int, ...]]) -> str:
    """Return the legend of the scene's colours, as HTML."""
    rows = [
        f'<div><span style="color:rgb{colour};font-size:1.3em">&#9679;</span> {html.escape(name)}</div>'
        for name, colour in colours.items()
    ]
    return f'<div style="margin:0 1em;font-size:0.875em">{"".join(rows)}</div>'


def _key_help() -> str:
    """Return the help on keys, as HTML."""
    drive = {name: " ".join(_shown(keys[name]) for keys in (ARROWS, WASD, KEYS) if name in keys) for name in KEYS}
    others = {"pause, go on": "P", "reset": "R", "planner or keys": "M"}
    rows = "".join(
        f'<tr><td style="padding-right:1em"><b>{key}</b></td><td>{name}</td></tr>'
        for name, key in (drive | others).items()
    )
    note = "A press is 0.5 m/s, or a quarter of the steering. Click into the scene first."
    return f'<div style="margin:0 1em;font-size:0.875em"><table>{rows}</table>{note}</div>'


def _shown(key: str) -> str:
    """Return the label of a key."""
    signs = {"arrowup": "\u2191", "arrowdown": "\u2193", "arrowleft": "\u2190", "arrowright": "\u2192"}
    return signs.get(key, key)
