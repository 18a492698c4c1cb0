import io
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.vehicle.tire_slip import slides_above


def pixels(draw):
    file = io.BytesIO()
    draw(file)
    file.seek(0)
    return matplotlib.image.imread(file, format="png")[:, :, :3]


@pytest.mark.slow
@each("name", fg.track_names())
def test_track_picture_shows_both_walls_all_the_way_round(name):
    track = fg.load_track(name)
    image = pixels(lambda file: fg.track_picture(track, file))
    height, width, _ = image.shape
    assert width == 1080
    assert 300 < height < 1000
    # the grey of the corridor covers about the share of the frame that the corridor has in the world
    corridor = np.all(np.abs(image - 0.95) < 0.01, axis=2).mean()
    area = track.length * float(np.mean(track.corridor_left + track.corridor_right))
    extent = np.ptp(np.concatenate((track.left_wall, track.right_wall)), axis=0) + 1.0
    assert corridor == pytest.approx(0.75 * area / np.prod(extent), rel=0.35)


def test_trace_picture_draws_what_was_measured(lap, monkeypatch):
    drawn = []
    monkeypatch.setattr("fg_mujoco.pictures.pages.figure_kit.save_figure", lambda figure, path: drawn.append(figure))
    fg.trace_picture(lap, "not written")
    (figure,) = drawn
    above, speed, steering, sliding, *tires = figure.axes[:8]

    (line,) = above.collections
    starts = np.array([segment[0] for segment in line.get_segments()])
    np.testing.assert_array_equal(starts, np.column_stack((lap.car.column("x_m"), lap.car.column("y_m")))[:-1])
    np.testing.assert_array_equal(line.get_array(), lap.car.column("speed_m_s")[:-1])
    assert "1 of 1 laps" in above.get_title()

    def curves(axes):
        return [np.asarray(curve.get_ydata()) for curve in axes.lines]

    def shows(axes, values):
        return any(np.array_equal(curve, values, equal_nan=True) for curve in curves(axes))

    assert shows(speed, lap.car.column("speed_m_s")) and shows(speed, lap.car.column("command_speed_m_s"))
    assert shows(steering, lap.car.column("steering_angle_rad"))
    assert shows(steering, lap.car.column("command_steering_rad"))
    for wheel, tire in zip(("front_left", "front_right", "rear_left", "rear_right"), tires, strict=True):
        assert tire.get_ylabel() == wheel.replace("_", "\n")
        assert tire.get_ylim() == tires[0].get_ylim()
        assert shows(tire, lap.car.column(f"friction_utilisation_{wheel}"))
        np.testing.assert_array_equal(tire.lines[0].get_xdata(), lap.car.column("progress_m"))
        assert shows(tire, [1.0, 1.0])
        assert shows(sliding, lap.car.column(f"slide_{wheel}_m_s"))
    assert slides_above(lap.car.tires_model) == 0.0  # past the peak: no line; bristles have one
    for axes in (speed, steering, sliding):  # the end of the lap
        assert any(np.array_equal(curve.get_xdata(), [lap.car.lap_times_s[0]] * 2) for curve in axes.lines)


def with_car(result, **changes):
    """Return a race of one car with other values in its car's result."""
    return replace(result, cars=(replace(result.car, **changes),))


@pytest.mark.slow
def test_trace_picture_of_a_race_of_no_tick(lap):
    """As of a planner that does not answer its first scan."""
    result = replace(with_car(lap, telemetry=lap.car.telemetry[:0], lap_times_s=()), sim_time_s=0.0)
    assert pixels(lambda file: fg.trace_picture(result, file)).shape[1] == 1080
