"""Values that a planner shows are in the debug page, the live view and a bag, of a node of ROS as of any planner."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from browsers import opened
from fg_mujoco.addons.look.live.browser import LiveView
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.racing.setup import Setup
from ros_planners import ROS2, commands, make, node2
from scan_worlds import corridor
from shown_values import SHOWS, file_of_shows

SCAN = corridor(1.0, 1.0, 5.0)
BEAMS = len(SCAN.ranges)


@pytest.fixture
def shows(tmp_path):
    return file_of_shows(tmp_path)


def test_debug_has_the_values_of_each_decision(shows):
    race = fg.race("oval", shows, time_limit=0.5)
    seen = fg.debug(race, window=0.5)
    assert [each.answer for each in seen.decisions] == [each.command for each in seen.decisions]
    for place, decision in enumerate(seen.decisions):
        ahead = float(decision.scan.ranges[BEAMS // 2])
        odd = {"odd": 1.0} if place % 2 == 0 else {}
        nothing = decision.numbers.pop("nothing known")
        assert math.isnan(nothing)
        assert decision.numbers == {"ahead": ahead, "count": place + 1.0} | odd
        np.testing.assert_array_equal(decision.scans["halved"], 0.5 * decision.scan.ranges)
        drawn = {each.name: each.points for each in decision.drawn}
        assert list(drawn) == ["hit", "box", "start"]
        np.testing.assert_allclose(drawn["hit"], [[ahead + race.world.parameters.lidar_offset, 0.0]])
        assert drawn["box"].tolist() == [[[0, 0], [1, 0]], [[1, 0], [1, 0.5]], [[1, 0.5], [0, 0]]]
        x, y, heading = decision.pose
        back = (-math.cos(heading) * x - math.sin(heading) * y, math.sin(heading) * x - math.cos(heading) * y)
        np.testing.assert_allclose(drawn["start"], [back])
    (note,) = seen.notes
    assert note.startswith("Value '<b>bad</b>' is not shown: it is of type str; accepted: a number")


@pytest.mark.slow
def test_the_page_has_a_table_and_a_plot_of_each_number_and_draws_the_rest(shows, tmp_path, page_of):
    seen = fg.debug(fg.race("oval", shows, time_limit=1.0), window=1.0)
    path = seen.write_page(tmp_path / "debug.html")
    with opened(page_of, path) as page:
        rows = page.locator(".numbers tbody tr")
        names = [row.locator("td").first.inner_text() for row in rows.all()]
        assert names == ["ahead", "count", "odd", "nothing known"]

        def values():
            return [cell.inner_text() for cell in page.locator(".numbers td:nth-child(2)").all()]

        ahead = seen.chosen.numbers["ahead"]
        assert values() == [f"{ahead:.4g}", "40", "\N{EN DASH}", "nan"]
        page.keyboard.press("Home")
        assert values()[1:] == ["1", "1", "nan"]
        plot = page.locator("canvas.over_time").nth(1)
        plot.click(position={"x": plot.bounding_box()["width"] - 8.0, "y": 20.0})
        assert values()[1] == "40"
        layers = page.inner_text("#layers").split("\n")
        assert {"raw", "halved", "hit", "box", "start"} <= {name.strip() for name in layers}

        def pixels():
            return page.evaluate("document.getElementById('top').toDataURL()")

        page.click("[data-switch='zoom'][value='12']")
        before = pixels()
        for name in ("halved", "box", "hit"):
            page.get_by_label(name, exact=True).uncheck()
            assert pixels() != before, name
            before = pixels()
        assert page.locator("img, b >> text=bad").count() == 0


def test_the_live_view_draws_the_values_of_its_own_car_on_the_map(shows, tmp_path):
    other = tmp_path / "other.py"
    other.write_text(SHOWS.replace('fg.show("', 'fg.show("other ').replace("0.2 * self.count", "0.1"))
    opponents = (fg.Entry(controller=f"{other}:Shows", start=fg.Start(s=12.0)),)
    session = LiveSession(Setup.of(track="oval", controller=shows, opponents=opponents))
    for _ in range(20):
        scan, pose = session.scan, session.simulation.pose
        session.tick()
    assert set(session.values.now) == {"ahead", "count", "odd", "nothing known", "halved", "hit", "box",
                                       "start"} - ({"odd"} if session.values.now["count"].array % 2 == 0 else set())
    assert session.message.startswith("value '<b>bad</b>' is not shown")
    sketches = {sketch.name: sketch for sketch in session.drawings()}
    assert set(sketches) == {"halved", "hit", "box", "start"}
    x, y, heading = pose
    reach = float(scan.ranges[BEAMS // 2]) + session.world.parameters.lidar_offset
    np.testing.assert_allclose(sketches["hit"].points[:, :2],
                               [[x + reach * math.cos(heading), y + reach * math.sin(heading)]])  # fmt: skip
    np.testing.assert_allclose(sketches["start"].points[:, :2], [[0.0, 0.0]])
    assert sketches["box"].points.shape == (3, 2, 3)
    assert sketches["halved"].points.shape[0] > 900
    session.by_hand = True
    session.tick()
    assert session.drawings() == [] and session.values.now == {}


NODE_SHOWS = """
        import fg_mujoco as fg
        from visualization_msgs.msg import Marker
        from nav_msgs.msg import Path
        self.goal, self.plan = self.create_publisher(Marker, "/goal", 1), self.create_publisher(Path, "/plan", 1)
        self.fg, self.kinds = fg, (Marker, Path)
"""
CALLBACK = """
Marker, Path = self.kinds
self.fg.show("ahead", message.ranges[len(message.ranges) // 2])
self.fg.show("halved", [0.5 * reach for reach in message.ranges])
self.fg.show("corner", (1.0, 2.0))
marker = Marker(id=1, type=Marker.SPHERE)
marker.header.frame_id, marker.scale.x, marker.pose.position.x = "laser", 0.2, 2.0
marker.color.r = marker.color.a = 1.0
self.goal.publish(marker)
path = Path()
path.header.frame_id = "base_link"
for at in range(3):
    path.poses.append(PoseStamped())
    path.poses[-1].pose.position.x = float(at)
self.plan.publish(path)
self.drive(1.0)
"""


@pytest.fixture
def node(tmp_path):
    """A node of ROS that shows values, and publishes a marker and a path."""
    return node2(tmp_path, CALLBACK, head=ROS2 + NODE_SHOWS)


def test_debug_draws_the_markers_and_paths_of_nodes_over_the_scan(node):
    race = fg.race("oval", node, time_limit=0.5)
    seen = fg.debug(race, window=0.2)
    for decision in seen.decisions:
        drawn = {each.name: each for each in decision.drawn}
        assert list(drawn) == ["corner", "/goal", "/plan"]
        offset = race.world.parameters.lidar_offset
        np.testing.assert_allclose(drawn["/goal"].points, [[offset + 2.0, 0.0]], atol=1e-6)
        assert drawn["/goal"].colour == (255, 0, 0)
        np.testing.assert_allclose(drawn["/plan"].points, [[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [2.0, 0.0]]],
                                   atol=1e-6)  # fmt: skip
        np.testing.assert_allclose(drawn["corner"].points, [[offset + 1.0, 2.0]])
        assert decision.numbers["ahead"] == np.float32(decision.scan.ranges[BEAMS // 2])
        assert "halved" in decision.scans


def test_debug_tells_a_node_what_surrounds_its_car(tmp_path):
    init = "self.create_subscription(Odometry, '/opp_racecar/odom', self.other, 1)"
    other = "\n    def other(self, message):\n        self.got['x'] = message.pose.pose.position.x\n"
    body = "import fg_mujoco as fg\nfg.show('other', self.got.get('x'))\nself.drive(0.1 + 0.1 * ('x' in self.got))"
    node = node2(tmp_path, body, init, other)
    entries = [fg.Entry(controller=node), fg.Entry(controller="wall_follow", start=fg.Start(s=3.0))]
    race = fg.race("oval", entries=entries, time_limit=0.5)
    seen = fg.debug(race, window=0.5)
    assert seen.notes == ()
    others = race.cars[1].column("x_m")
    told = [decision.numbers.get("other", math.nan) for decision in seen.decisions]
    np.testing.assert_allclose(
        told[1:], others[: len(told) - 1], atol=0.2
    )  # the message of that tick, or the one before
    assert told[-1] > told[1]


# markers, paths and poses that nodes publish: drawings in the live view


MARKERS = """
        from visualization_msgs.msg import Marker, MarkerArray
        from nav_msgs.msg import Path
        from geometry_msgs.msg import Point, PoseStamped
        from std_msgs.msg import ColorRGBA
        self.create_subscription(Odometry, "/odom", lambda m: self.got.update(odom=m), 1)
        self.markers = self.create_publisher(MarkerArray, "/waypoints", 1)
        self.marker = self.create_publisher(Marker, "/goal", 1)
        self.path = self.create_publisher(Path, "/plan", 1)
        self.count = 0

        def show():
            self.count += 1
            one = Marker(id=self.count % 2, type=Marker.SPHERE, ns="a", color=ColorRGBA(r=1.0, a=1.0))
            one.header.frame_id, one.scale.x, one.pose.position.x = "base_link", 0.3, 1.0
            strip = Marker(id=7, type=Marker.LINE_STRIP, ns="b", color=ColorRGBA(b=1.0, a=1.0))
            strip.header.frame_id, strip.scale.x = "map", 0.05
            strip.points = [Point(x=float(i)) for i in range(4)]
            self.markers.publish(MarkerArray(markers=[one, strip]))
            brief = Marker(id=1, type=Marker.CUBE, color=ColorRGBA(g=1.0, a=1.0))
            brief.header.frame_id, brief.lifetime.nanosec = "map", 20_000_000
            if self.count == 1:
                self.marker.publish(brief)
            path = Path()
            path.header.frame_id = "map"
            path.poses = [PoseStamped() for _ in range(3)]
            self.path.publish(path)

        self.show = show
"""


@pytest.fixture
def source(tmp_path):
    return node2(tmp_path, "self.show()\nself.drive(1.0)", head=ROS2 + MARKERS)


def test_drawings_are_those_of_rviz_in_the_frame_of_the_map(source):
    planner = make(source)
    assert planner.drawings() == []  # from here on they are kept
    commands(planner, 1)
    red, blue, green, path = sorted(planner.drawings(), key=lambda each: each.colour, reverse=True)[0:1] + [
        next(each for each in planner.drawings() if each.colour == colour) for colour in ((0, 0, 255), (0, 255, 0))
    ] + [next(each for each in planner.drawings() if each.colour == (60, 200, 90))]  # fmt: skip
    assert red.colour == (255, 0, 0)
    assert red.size == 0.3
    np.testing.assert_allclose(red.points, [[1.0, 0.0, 0.0]])  # a metre ahead of the car, which is at 0
    np.testing.assert_allclose(blue.points[:, 0, 0], [0.0, 1.0, 2.0])
    np.testing.assert_allclose(blue.points[:, 1, 0], [1.0, 2.0, 3.0])
    assert path.points.shape == (2, 2, 3)
    assert len(green.points) == 1
    commands(planner, 3)
    colours = [each.colour for each in planner.drawings()]
    assert colours.count((255, 0, 0)) == 2  # by their ids
    assert (0, 255, 0) not in colours  # its lifetime is over


@pytest.mark.slow
def test_the_live_view_draws_what_a_node_shows(source, page_of):
    session = LiveSession(Setup.of(track="oval", controller=source))
    assert session.drawings() == []
    for _ in range(3):
        session.tick()
    assert len(session.drawings()) == 4
    with LiveView(session, port=8097) as view:
        view._scene.show_drawings()
        assert sorted(name for name, _ in view._scene._shown.values()) == [f"/shown_{number}" for number in range(3)]
        session.reset()
        session.tick()
        view._scene.show_drawings()


def test_a_race_is_the_same_whether_its_nodes_are_watched_or_not(source):
    watched = make(source)
    watched.drawings()
    assert commands(watched, 5) == commands(make(source), 5)
    assert fg.race("oval", source, laps=1, time_limit=0.3).car.max_speed_m_s > 0.3
