"""A race to be watched as it goes: its knobs, without a browser and in one, and what is refused."""

import asyncio
import contextlib
import math
import socket
import threading
import time
import urllib.request

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.look.live.browser_scene import LEGEND
from fg_mujoco.addons.look.live.browser_shapes import world_shapes
from fg_mujoco.addons.look.live.handshake import is_own
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.errors import EngineError
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.telemetry import TELEMETRY
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED
from refusals import refused

TICK = 0.025  # [s]
FAILS_LATE = """import numpy as np
import fg_mujoco as fg
class Late:
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=self.steer(scan, odometry), speed=1.0)
    def steer(self, scan, odometry):
        return np.average(scan.bearings, weights=scan.ranges[:3]) if odometry.stamp > 0.49 else 0.0  # line 9
"""


def drive(session, seconds):
    for _ in range(round(seconds / TICK)):
        session.tick()


@pytest.fixture
def session():
    return LiveSession(Setup.of(track="oval"))


def test_planner_that_does_not_know_of_wet_ground_slides_and_one_that_does_holds(session):
    session.change("mu", 0.5)
    session.change("planner_mu", 0.5)
    greatest = 0.0
    for _ in range(240):
        session.tick()
        greatest = max(greatest, session.sliding_speed)
    assert greatest < 0.06
    session.change("planner_mu", 1.0489)
    session.reset()
    drive(session, 1.0)
    assert session.sliding_speed > SLIDING_SPEED and session.slides


def test_settings_of_the_planner_can_be_changed_and_bad_ones_are_refused(session):
    session.change("planner.lookahead", 4.0)
    session.tick()
    assert session.planner_settings == {"lookahead": 4.0}
    for name, value in (("planner.lookahead", -1.0), ("planner.nothing", 1.0), ("max_speed", 0.0), ("colour", 1.0)):
        session.change(name, value)
        session.tick()
        assert "accepted" in session.message
    assert session.planner_settings == {"lookahead": 4.0}
    assert session.settings.max_speed == 8.0


def test_keys_drive(session):
    for _ in range(4):
        session.key("faster")
    drive(session, 1.5)
    assert session.by_hand
    assert session.simulation.speed == pytest.approx(2.0, abs=0.1)
    heading = session.simulation.pose[2]
    session.key("left")
    drive(session, 0.5)
    assert session.simulation.pose[2] > heading + 0.1
    session.key("stop")
    drive(session, 1.5)
    assert session.simulation.speed == pytest.approx(0.0, abs=0.05)


def test_a_crash_ends_it_until_the_reset(session):
    for _ in range(8):
        session.key("faster")
    for _ in range(60):
        session.key("left")
        drive(session, 0.1)
    assert session.simulation.crashed
    at = session.simulation.time
    drive(session, 0.5)
    assert session.simulation.time == at
    assert "reset" in session.message
    session.by_hand = False
    session.reset()
    drive(session, 0.5)
    assert session.simulation.time == pytest.approx(0.5)


def test_points_are_where_the_walls_are(session):
    drive(session, 1.0)
    track, points = session.world.track, session.scan_points(9)
    assert len(points) > 50
    _, offsets = track.project(points[:, :2])
    assert np.abs(offsets) == pytest.approx(track.corridor_left[0], abs=0.02)  # as wide everywhere, to either side
    x, y, _ = session.simulation.pose
    assert np.hypot(*(session.goal()[:2] - (x, y))) < 12.0


@pytest.fixture
def taken():
    """A port that somebody listens on."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


@pytest.fixture
def free():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    return port


@each("arguments, said",
      [(["--web", "--port", "{taken}"], "in use"),
       (["--web", "--port", "0"], "1 to 65535"),
       (["--web", "--host", "203.0.113.7"], "cannot be listened on"),
       (["--port", "8081"], "--web"),
       ([], "no display here; accepted: --web"),
       (["--web", "--port", "{free}", "--track", "nowhere"], "nowhere"),
       (["--web", "--port", "{free}", "--controller", "nobody"], "nobody"),
       (["--web", "--port", "{free}", "--max-speed", "-1"], "--max-speed is -1")])  # fmt: skip
def test_what_cannot_be_is_refused_in_one_line(arguments, said, taken, free, here, monkeypatch, capsys):
    pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("platform.system", lambda: "Linux")
    assert said in refused(here, capsys, "view", *(text.format(taken=taken, free=free) for text in arguments))


@contextlib.contextmanager
def served(session, port, wait=False):
    """A view that drives on."""
    from fg_mujoco.addons.look.live.browser import LiveView

    with LiveView(session, port=port) as view:
        thread = threading.Thread(target=lambda: view.run(wait=wait))
        thread.start()
        try:
            yield view
        finally:
            view.close()
            thread.join(10.0)


def wait_until(holds, seconds=30.0):
    until = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < until
        time.sleep(0.05)


@each("hosts, origins, own",
      [(["localhost:8080"], [], True),
       (["LOCALHOST:8080"], ["http://localhost:8080"], True),
       (["127.0.0.1:8080"], ["http://127.0.0.1:8080"], True),
       (["[::1]:8080"], ["http://[::1]:8080"], True),
       (["box:9000"], ["http://box:9000"], True),
       (["localhost:8080"], ["http://evil.example"], False),
       (["localhost:8080"], ["https://localhost:8080"], False),
       (["localhost:8080"], ["http://localhost:9090"], False),
       (["localhost:8080"], ["http://localhost:8080.evil.example"], False),
       (["localhost:8080"], ["null"], False),
       (["localhost:8080"], [""], False),
       (["evil.example:8080"], [], False),
       (["evil.example:8080"], ["http://evil.example:8080"], False),
       (["localhost.evil.example:8080"], [], False),
       (["evil@localhost:8080"], ["http://evil@localhost:8080/"], False),
       (["[::1:8080"], [], False),
       ([""], [], False),
       ([], [], False),
       (["localhost:8080", "evil.example"], [], False),
       (["localhost:8080"], ["http://localhost:8080", "http://evil.example"], False)])  # fmt: skip
def test_a_request_is_of_the_views_own_page_or_of_none(hosts, origins, own):
    assert is_own(hosts, origins, frozenset({"box"})) is own


def test_pages_of_other_sites_are_refused_before_they_are_answered(session, free):
    pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    upgrade = ("Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
               "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: viser-v0\r\n")  # fmt: skip

    def status(host, origin=None, more=""):
        said = "" if origin is None else f"Origin: {origin}\r\n"
        with socket.create_connection(("127.0.0.1", free), 10.0) as connection:
            connection.sendall(f"GET / HTTP/1.1\r\nHost: {host}\r\n{said}{more}\r\n".encode())
            return int(connection.recv(64).split()[1])

    own = f"localhost:{free}"
    with served(session, free) as view:
        assert view.url == f"http://localhost:{free}"
        wait_until(lambda: session.simulation.time > 0.2)
        here = socket.gethostbyname(socket.gethostname())
        if not here.startswith("127."):  # it listens on this machine alone
            with pytest.raises(OSError):
                socket.create_connection((here, free), 2.0)
        assert (status(own), status(own, more=upgrade), status(own, f"http://{own}", upgrade)) == (200, 101, 101)
        for host, origin in ((own, "http://evil.example"), (f"evil.example:{free}", f"http://evil.example:{free}")):
            assert (status(host, origin), status(host, origin, upgrade)) == (403, 403)
        assert status(f"evil.example:{free}") == 403


def test_a_race_that_waits_stands_until_a_browser_comes_and_ends_without_one(session, free):
    pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    from fg_mujoco.addons.look.live.browser import LiveView

    with LiveView(session, port=free) as view:
        thread = threading.Thread(target=lambda: view.run(wait=True))
        thread.start()
        time.sleep(0.5)
        assert urllib.request.urlopen(f"http://localhost:{free}", timeout=10.0).status == 200  # no browser yet
        assert session.simulation.time == 0.0
        view.close()
        thread.join(10.0)
        assert not thread.is_alive()


def test_a_server_that_cannot_be_guarded_is_not_used(session, free, monkeypatch):
    viser = pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    from fg_mujoco.addons.look.live.browser import LiveView

    stopped = []

    class Other:
        def __init__(self, **settings):
            pass

        def stop(self):
            stopped.append(self)

    monkeypatch.setattr(viser, "ViserServer", Other)
    with pytest.raises(EngineError, match="version of viser"):
        LiveView(session, port=free)
    assert len(stopped) == 1


@each("error", [RuntimeError("deque mutated during iteration"), asyncio.InvalidStateError()])
def test_a_race_goes_on_where_the_viewer_fails(error, session, free, monkeypatch):
    """Viser wakes an asyncio event from our thread: while its own removes a page from those that wait, that raises."""
    pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    from fg_mujoco.addons.look.live.browser_scene import LiveScene

    def fails(scene):
        monkeypatch.undo()
        raise error

    with pytest.warns(UserWarning, match="left out a picture"), served(session, free) as view:
        show = LiveScene.show
        monkeypatch.setattr(LiveScene, "show", fails)
        wait_until(lambda: LiveScene.show is show)
        at = session.simulation.time
        wait_until(lambda: session.simulation.time > at + 0.2)
        assert not view._stop.is_set()


class Marks:
    """Steers hard on wet ground, and shows where it looks from 0.1 s on."""

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        if odometry.stamp > 0.1:
            fg.show("<looks at>", (1.0, 0.0))
        return fg.DriveCommand(steering_angle=0.4 if odometry.stamp > 1.0 else 0.0, speed=8.0)


def test_the_page_says_that_a_tire_slides_how_a_planner_shows_values_and_names_those_that_it_shows(free):
    pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    from fg_mujoco.addons.look.live.browser import LiveView

    session = LiveSession(Setup.of(track="oval", controller=Marks(), mu=0.4))
    with LiveView(session, port=free) as view:
        view._show_texts()
        assert "no tire slides" in view._status.content and "fg&#46;show" in view._values.content
        assert view._values.visible and "looks at" not in view._legend.content
        drive(session, 1.4)
        view._show_texts()
        assert session.slides and "a tire slides" in view._status.content and "well" not in view._status.content
        assert not view._values.visible and "&lt;looks at&gt;" in view._legend.content


def test_in_a_browser_the_car_moves_and_pause_and_knobs_and_keys_do_what_they_say(session, free, page_of):
    pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    asked = []
    with served(session, free, wait=True) as view, page_of(viewport={"width": 500, "height": 300}) as page:
        page.on("request", lambda request: asked.append(request.url))
        assert session.simulation.time == 0.0  # it waits for its first browser
        page.goto(view.url)
        page.wait_for_selector("text=friction utilisation", timeout=60000)
        page.wait_for_selector("canvas")
        before, at = page.screenshot(), session.simulation.time
        wait_until(lambda: session.simulation.time > at + 1.0)
        page.wait_for_timeout(500)
        assert page.screenshot() != before

        page.get_by_role("button", name="pause").click()
        wait_until(lambda: session.paused)
        stands = session.simulation.time
        page.get_by_role("button", name="go on").wait_for()
        session.message = "my_own_planner{ <b>x</b> *_ $a$ | \\ [y](z)"  # as an error's text may be
        page.get_by_text(session.message, exact=True).wait_for()
        assert session.simulation.time == stands
        page.get_by_role("button", name="go on").click()
        wait_until(lambda: session.simulation.time > stands)

        (box,) = [field for field in page.locator("input[type=text]").all() if field.input_value() == "8"]
        box.fill("1.5")
        box.press("Enter")
        wait_until(lambda: session.settings.max_speed == 1.5)
        wait_until(lambda: math.isclose(session.simulation.speed, 1.5, abs_tol=0.15))

        page.mouse.click(200, 250)
        for key, reached in (("i", 0.5), ("ArrowUp", 1.0), ("w", 1.5), ("ArrowDown", 1.0), ("s", 0.5), (" ", 0.0)):
            page.keyboard.press(key)
            wait_until(lambda reached=reached: session.by_hand and session.hand.speed == reached)
        for key, turns_left in (("ArrowLeft", True), ("d", False), ("a", True), ("ArrowRight", False)):
            page.keyboard.press(key)
            wait_until(lambda left=turns_left: (session.hand.steering > 0.0) == left)
        for text in (*LEGEND, "pause, go on", "quarter of the steering"):
            assert page.get_by_text(text).first.is_visible(), text
        page.keyboard.press("ArrowUp")
        wait_until(lambda: session.hand.speed == 0.5)
        page.get_by_role("button", name="reset").click()
        wait_until(lambda: session.hand.speed == 0.0)
    own = (f"http://localhost:{free}", f"ws://localhost:{free}", "data:", "blob:")
    assert [url for url in asked if not url.startswith(own)] == []


# several cars: one by planner or keys, the others by their planners


RIVALS = (fg.Entry(controller="disparity_extender", max_speed=2.0), fg.Entry(max_speed=3.0, vehicle="nuc2"))


def tick(session, ticks):
    for _ in range(ticks):
        session.tick()


def places(session):
    return session.world.cars[0].pose(session.simulation.data), session.world.cars[1].pose(session.simulation.data)


def test_session_drives_as_a_race_of_the_same_cars_does():
    session = LiveSession(Setup.of(max_speed=4.0, opponents=RIVALS))
    race = fg.race("oval", entries=[fg.Entry(max_speed=4.0), *RIVALS], laps=1, time_limit=2.0)
    tick(session, 79)
    np.testing.assert_array_equal(session.simulation.state[: session.world.model.nq + 1],
                                  race.states[79, : session.world.model.nq + 1])  # fmt: skip
    row = race.car.telemetry[78]
    first = TELEMETRY.index("friction_utilisation_front_left")
    assert session.friction_utilisation == np.nanmax(row[first : first + 4])


def test_keys_drive_the_own_car_and_planners_the_others():
    session = LiveSession(Setup.of(opponents=RIVALS[:1]))
    before = places(session)
    session.by_hand = True
    tick(session, 40)
    own, rival = places(session)
    assert own[:2] == pytest.approx(before[0][:2], abs=0.05)  # no key was pressed
    assert rival[0] > before[1][0] + 0.5
    for _ in range(4):
        session.key("faster")
    tick(session, 40)
    assert session.simulation.speed > 1.0


def test_other_tires_of_the_own_car_leave_all_where_they_are():
    session = LiveSession(Setup.of(opponents=RIVALS[:1]))
    tick(session, 30)
    before = places(session)
    session.change("mu", 0.4)
    session.paused = True
    session.tick()
    assert session.world.cars[0].mu == 0.4 and session.world.cars[1].mu == pytest.approx(1.0489)
    for was, now in zip(before, places(session), strict=True):
        assert now == pytest.approx(was)
    session.paused = False
    tick(session, 20)
    assert places(session)[1][0] > before[1][0] + 0.3


def test_opponent_that_crashes_stands_and_is_told_of():
    rival = fg.Entry(controller=OnAnArc(), start=fg.Start(s=3.0))
    session = LiveSession(Setup.of(opponents=(rival,)))
    session.by_hand = True
    for _ in range(400):
        session.tick()
        if session.message:
            break
    assert session.message == "car_1 crashed"
    session.simulation.engine.commands[1] = 0.0, 5.0
    tick(session, 60)
    stands = places(session)[1]
    tick(session, 20)
    assert places(session)[1] == pytest.approx(stands, abs=1e-3)


class OnAnArc:
    """Drives on an arc, into whatever is there."""

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=0.1, speed=4.0)


def test_browser_has_the_shapes_of_all_cars():
    session = LiveSession(Setup.of(opponents=RIVALS))
    model, shapes = world_shapes(session.world)
    bodies = {model.body(shape.body).name for shape in shapes}
    assert {"car/base_link", "car_1/base_link", "car_2/base_link"} <= bodies


def test_it_pauses_and_says_so_when_its_planner_fails_until_the_reset(here):
    (here / "mine.py").write_text(FAILS_LATE)
    session = LiveSession(Setup.of(track="oval", controller="mine.py:Late"))
    for _ in range(30):
        session.tick()
    assert session.paused and session.simulation.time == pytest.approx(0.5)
    assert "TypeError: Axis" in session.message and session.message.endswith("(mine.py, line 9)")
    assert 'File "mine.py", line 9, in steer' in session.failure.traceback
    session.reset()
    session.tick()
    assert (session.failure, session.message, session.simulation.time) == (None, "", 0.0)
