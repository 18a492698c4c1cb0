"""Markers, paths and poses that nodes publish: drawings in the live view."""


import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.addons.look.live.browser import LiveView
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.racing.setup import Setup
from ros_planners import ROS2, commands, make, node2

SHOWS = """
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
    return node2(tmp_path, "self.show()\nself.drive(1.0)", head=ROS2 + SHOWS)


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
