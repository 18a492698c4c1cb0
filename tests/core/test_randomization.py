"""What is drawn for a world: from its seed alone, within its range, each parameter whatever the others are."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from fg_mujoco.course.random_obstacles import CLEAR_AHEAD, CLEAR_BEHIND, SPACING
from fg_mujoco.errors import SettingsError
from fg_mujoco.racing.randomization import PARAMETERS, Randomization, Uniform, as_range, world_seeds
from fg_mujoco.simulation.course_loading import default_car

OVAL = fg.load_track("oval")
SOME = {  # a range for each parameter
    "mu": (0.6, 1.2), "mass": (3.2, 4.5), "cog_height": (0.05, 0.09), "steering_gain": (0.5, 1.0),
    "speed_gain": (0.5, 1.0), "command_delay": (0.0, 0.1), "lidar_noise": (0.0, 0.05), "lidar_dropout": (0.0, 0.1),
    "start_s": (0.0, 30.0), "start_offset": (-0.3, 0.3), "start_heading": (-0.2, 0.2), "start_speed": (0.0, 3.0),
    "planner_mu": [0.7, math.inf], "max_speed": (4.0, 8.0), "obstacles": "0:4", "odometry_drift": (-0.1, 0.1),
    "planner.lookahead": (5.0, 12.0), "planner.edge_weight": [0.9, 0.99],
}  # fmt: skip

BEND = 0.1  # [m] a place beside a corner point of the line is nearest to another point of the line than its own

SEEDS = st.integers(0, 2**63 - 1)
NUMBERS = st.floats(-1e6, 1e6)
VALUES = st.one_of(
    st.integers(-1000, 1000), st.floats(allow_nan=False), st.booleans(), st.sampled_from(["a", "two_words", "v1.2"])
)


# -- ranges


@given(low=NUMBERS, high=NUMBERS)
def test_a_range_reads_back_from_its_text(low, high):
    low, high = sorted((low, high))
    assert as_range(str(Uniform(low, high))) == as_range((low, high)) == Uniform(low, high)


@given(st.lists(VALUES, min_size=1, max_size=5))
def test_a_list_reads_back_from_its_text(values):
    read = as_range(str(as_range(values)))
    assert read.values == tuple(values)
    assert [type(v) for v in read.values] == [type(v) for v in values]


@given(low=NUMBERS, high=NUMBERS, share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_value_is_within_its_range_and_as_far_along_as_its_share(low, high, share):
    low, high = sorted((low, high))
    value = Uniform(low, high).at(share)
    assert low <= value <= high
    assert value == pytest.approx((1.0 - share) * low + share * high, abs=1e-9 * max(1.0, abs(low), abs(high)))


@pytest.mark.slow
@given(st.text(max_size=12))
def test_any_other_text_is_refused_in_one_line(text):
    try:
        as_range(text)
    except SettingsError as error:
        assert "accepted" in str(error)
        assert "\n" not in str(error).replace(repr(text), "")


def test_the_same_ranges_in_another_order_are_the_same_randomisation():
    backwards = dict(reversed(SOME.items()))
    assert Randomization.of(backwards) == Randomization.of(SOME)
    assert list(Randomization.of(backwards).ranges) == list(Randomization.of(SOME).ranges)


# -- draws


@settings(deadline=None, max_examples=50)
@given(seed=SEEDS, names=st.sets(st.sampled_from(sorted(SOME))))
def test_what_is_drawn_for_a_parameter_does_not_depend_on_the_others(seed, names):
    everything = Randomization.of(SOME).draw(seed)
    some = Randomization.of({name: SOME[name] for name in names}).draw(seed)
    assert some == {name: everything[name] for name in names}


@settings(deadline=None, max_examples=50)
@given(seed=SEEDS)
def test_a_world_depends_on_its_seed_alone(seed):
    sites = OVAL.obstacle_sites(default_car())
    first = Randomization.of(SOME).scenario(OVAL, seed)
    Randomization.of(SOME).scenario(OVAL, seed ^ 1, sites=sites)
    assert Randomization.of(SOME).scenario(OVAL, seed, sites=sites) == first
    assert Randomization.of(SOME).scenario(OVAL, seed ^ 1) != first


def test_each_parameter_is_drawn_over_its_whole_range_and_by_itself():
    randomization = Randomization.of({name: (1.0, 2.0) for name in PARAMETERS if name in ("mu", "max_speed")} | {
        "start_s": (1.0, 2.0), "planner.a": (1.0, 2.0), "planner.b": (1.0, 2.0)
    })  # fmt: skip
    drawn = np.array([list(randomization.draw(seed).values()) for seed in range(2000)]) - 1.0
    assert np.abs(np.sort(drawn, axis=0) - np.linspace(0.0, 1.0, 2000)[:, None]).max() < 0.04  # Kolmogorov: p < .005
    assert np.abs(np.corrcoef(drawn.T) - np.eye(5)).max() < 0.1


def test_the_worlds_of_known_seeds_never_change():
    # a new parameter goes to the end of PARAMETERS: results of before can be driven again
    drawn = Randomization.of({"mu": (0.0001, 1.0001), "max_speed": (1.0, 2.0), "planner.a": (0.0, 1.0)}).draw(7)
    assert list(drawn.values()) == pytest.approx([0.7979591868433563, 1.903472572120946, 0.8831683829332999])
    assert world_seeds(0, 2).tolist() == [5737240835340368, 2430022687152954]


def test_seeds_of_worlds_do_not_depend_on_how_many_there_are():
    assert world_seeds(3, 1000)[:10].tolist() == world_seeds(3, 10).tolist()
    assert set(world_seeds(3, 1000)).isdisjoint(world_seeds(4, 1000))
    assert 0 <= world_seeds(3, 1000).min() <= world_seeds(3, 1000).max() < 2**53


def test_what_is_drawn_reaches_the_scenario():
    values = Randomization.of(SOME).draw(5)
    scenario = Randomization.of(SOME).scenario(OVAL, 5)
    assert scenario.seed == 5
    assert scenario.track is OVAL
    found = {
        "mu": scenario.changes.mu, "mass": scenario.changes.mass,
        "cog_height": scenario.changes.center_of_gravity_height,
        "steering_gain": scenario.changes.steering_gain, "speed_gain": scenario.changes.speed_gain,
        "command_delay": scenario.changes.command_delay, "lidar_noise": scenario.effects.range_noise_std,
        "lidar_dropout": scenario.effects.dropout_probability, "start_s": scenario.start.s,
        "start_offset": scenario.start.offset, "start_heading": scenario.start.heading,
        "start_speed": scenario.start.speed, "planner_mu": scenario.planner_mu, "max_speed": scenario.max_speed,
        "obstacles": len(scenario.obstacles), "odometry_drift": scenario.odometry_drift,
        "planner.lookahead": scenario.planner_settings["lookahead"],
        "planner.edge_weight": scenario.planner_settings["edge_weight"],
    }  # fmt: skip
    assert found == values


# -- obstacles


@settings(deadline=None, max_examples=60)
@given(
    seed=SEEDS,
    name=st.sampled_from(["oval", "hairpins", "l_corridor", "tight"]),
    start=st.floats(-20.0, 200.0),
    part=st.floats(0.0, 1.0),
)
def test_obstacles_leave_a_way_past_them_and_the_start_clear(seed, name, start, part):
    track = fg.load_track(name)
    sites = track.obstacle_sites(default_car())
    count = round(part * sites.most)
    boxes = sites.place(count, start, np.random.default_rng(seed))
    assert len(boxes) == count
    middles = np.array([(box.x, box.y) for box in boxes]).reshape(-1, 2)
    s, _ = track.project(middles)
    ahead = (s - start) % track.length
    assert (ahead >= CLEAR_AHEAD - BEND).all()
    assert (ahead <= track.length - CLEAR_BEHIND + BEND).all()
    assert (np.diff(ahead) >= SPACING - BEND).all()  # in the order in which a car meets them
    for box in boxes:
        to_right, to_left = _free(box, track.right_wall), _free(box, track.left_wall)
        assert max(to_right, to_left) > 0.93 * sites.gap


def _free(box, wall):
    """Distance from a box to a wall [m]: from its corners to the wall's segments, and from its points to the sides."""
    corners = box.corners()
    return min(_distance(corners, wall), _distance(wall, corners))


def _distance(points, polygon):
    step = np.roll(polygon, -1, axis=0) - polygon
    away = points[:, None] - polygon
    share = np.clip((away * step).sum(axis=2) / (step * step).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(away - share[..., None] * step, axis=2).min()


def test_more_obstacles_than_there_is_room_for_are_refused():
    sites = OVAL.obstacle_sites(default_car())
    assert len(sites.place(sites.most, 0.0, np.random.default_rng(0))) == sites.most
    with pytest.raises(SettingsError, match=f"accepted: at most {sites.most}"):
        sites.place(sites.most + 1, 0.0, np.random.default_rng(0))
