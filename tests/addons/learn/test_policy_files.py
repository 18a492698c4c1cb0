"""Policy files: what is written is read and drives with the same bits; what does not fit is refused in one line."""

import importlib.util
import json
import math
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from driven_environments import race_as_environment
from fg_mujoco.addons.learn.policy_files import read_policy, save_policy
from fg_mujoco.addons.learn.policy_shapes import observed_shapes
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.racing.resimulation import recorded_planner
from refusals import refused
from small_policies import FLAT, PARTS, interface_of, network_for, weights_for

EXAMPLES = Path(__file__).parents[3] / "examples"


def written(path, settings=FLAT, **network):
    """A policy file of random weights, and its path as a text."""
    interface = interface_of(**settings)
    return str(save_policy(network_for(interface, **network), path, interface, trained={"steps": 3}))


def test_a_model_with_an_endless_loop_ends_a_decision(tmp_path, monkeypatch):
    """No signal interrupts its code. It loops where the observation's first value is above 0."""
    path = written(tmp_path / "loops.onnx", PARTS)
    onnx = pytest.importorskip("onnx", reason="onnx is not installed")
    model, of = onnx.load(path), onnx.TensorProto
    node, value = onnx.helper.make_node, onnx.helper.make_tensor_value_info
    body = onnx.helper.make_graph([node("Identity", ["go"], ["going"]), node("Identity", ["x"], ["same"])],
                                  "body",
                                  [value("count", of.INT64, []), value("go", of.BOOL, []), value("x", of.FLOAT, None)],
                                  [value("going", of.BOOL, []), value("same", of.FLOAT, None)])  # fmt: skip
    model.graph.node[-1].output[0], out = "made", model.graph.output[0].name
    first = [node("ReduceMax", ["speed"], ["fastest"], keepdims=0), node("Greater", ["fastest", "zero"], ["fast"])]
    model.graph.initializer.append(onnx.helper.make_tensor("zero", of.FLOAT, [], [0.0]))
    model.graph.node.extend([*first, node("Loop", ["", "fast", "made"], [out], body=body)])
    onnx.save(model, path)
    monkeypatch.setattr("fg_mujoco.addons.learn.onnx_policy.LONGEST", 0.3)
    policy = read_policy(path)
    shapes = observed_shapes(policy.interface)
    observation = {name: np.zeros(shape, np.float32) for name, shape in shapes.items()}
    assert policy.act(observation).shape == (2,)
    for _ in range(2):
        with pytest.raises(TimeoutError, match=r"no answer within 0.3 s"):
            policy.act(observation | {"speed": np.ones(shapes["speed"], np.float32)})
    result = fg.race("oval", path, time_limit=1.0)
    assert result.car.end_reason == "planner_failed" and result.car.end_time_s > 0.0


@each("settings", [FLAT, PARTS])
def test_a_file_answers_as_its_network_by_hand(settings, tmp_path):
    policy, own = read_policy(written(tmp_path / "first", settings)), weights_for(interface_of(**settings))
    assert (policy.interface, policy.trained) == (interface_of(**settings), {"steps": 3})
    shapes, rng = observed_shapes(policy.interface), np.random.default_rng(2)
    parts = {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}
    seen = np.concatenate(list(parts.values()))
    hidden = np.tanh(own["first"] @ np.clip((seen - own["mean"]) / own["std"], -3.0, 3.0))
    found = policy.act(parts if settings is PARTS else parts["observation"])
    np.testing.assert_allclose(found, own["second"] @ hidden + own["bias"], atol=1e-6)


@each("form, settings", product(("policy", "policy.onnx"), (FLAT, PARTS)))
def test_it_commands_in_a_race_what_it_commands_in_the_environment(form, settings, tmp_path):
    gym_environment = pytest.importorskip("fg_mujoco.envs.gym_environment", exc_type=ImportError)
    controller = written(tmp_path / form, settings)
    race_as_environment(gym_environment.F1TenthEnv(track="hairpins", start="line", **settings), controller, 40)


def changed(path, **changes):
    """Write a policy's file anew, with some values of its description changed; inner keys follow two underscores."""
    onnx = pytest.importorskip("onnx", reason="onnx is not installed")
    model = onnx.load(path)
    found = json.loads(model.metadata_props[0].value)
    for name, value in changes.items():
        *inner, last = name.split("__")
        place = found
        for key in inner:
            place = place[key]
        place[last] = value
    model.metadata_props[0].value = json.dumps(found)
    onnx.save(model, path)


@each("changes, said",
      [({"interface__beams__count": 541}, "trained with 541 beams from -135.0 to 135.0 deg, the car's LiDAR has 1081"),
       ({"interface__beams__count": 10**12}, "beams.count is 1000000000000; accepted: a whole number"),
       ({"interface__sensors": [{"name": "pose", "values": 10**12}]}, "sensors.values is 1000000000000; accepted"),
       ({"interface__period": 0.05}, "trained with a scan every 0.05 s, the car's LiDAR has one every 0.025 s"),
       ({"interface__observation": "speed,yaw_rate,beams:20"}, "takes speed (1), scan (54), yaw_rate (1), its"),
       ({"interface__observation": "spede,beams:54"}, "did you mean 'speed'?"),
       ({"interface__period": None}, "period is None"),
       ({"format": "fg_mujoco policy 9"}, "its format is 'fg_mujoco policy 9'"),
       ({"interface__car__gravity": "g"}, "its interface is damaged"),
       ({"interface__beams__angle_min": math.nan}, "interface.beams.angle_min is nan")])
def test_what_does_not_fit_is_refused_before_the_race(changes, said, tmp_path, capsys):
    path = tmp_path / "policy" / "policy.onnx"
    written(path, PARTS)
    changed(path, **changes)
    assert said in refused(tmp_path, capsys, "race", "--controller", str(path))


def test_a_policy_that_sees_what_no_car_senses_is_refused(tmp_path, capsys):
    path = written(tmp_path / "policy.onnx", {"observation": "speed,mu,beams:54"})
    assert "observes mu, which a car does not sense" in refused(tmp_path, capsys, "race", "--controller", path)


@each("name, content, said",
      [("policy.json", b"{}", "is gone; instead: policy.onnx, which save_policy"),
       ("policy.onnx", b"not one", "is no ONNX model"),
       ("policy.zip", b"not one", "is no zip file of Stable-Baselines3")])  # fmt: skip
def test_what_is_no_policy_file_is_refused(name, content, said, tmp_path, capsys):
    if name.endswith(".onnx"):
        pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    (tmp_path / name).write_bytes(content)
    assert said in refused(tmp_path, capsys, "race", "--controller", str(tmp_path / name))
    if name.endswith(".json"):
        assert said in refused(tmp_path, capsys, "race", "--controller", str(tmp_path))  # the folder that has it
        with pytest.raises(ControllerError, match=r"is gone; instead: policy\.onnx"):
            save_policy(None, tmp_path / name)


def test_what_is_no_network_is_refused():
    with pytest.raises(SettingsError, match=r"a .onnx file of a dict; accepted: of a model of Stable-Baselines3"):
        save_policy({}, "policy.onnx", interface_of(**PARTS))


def test_an_onnx_model_of_another_shape_or_without_an_interface_is_refused(tmp_path):
    onnx = pytest.importorskip("onnx", reason="onnx is not installed")
    path = tmp_path / "policy.onnx"
    written(path, PARTS)
    model = onnx.load(path)
    described = json.loads(model.metadata_props[0].value)
    described["interface"] |= {"observation": "speed,beams:20,yaw_rate"}
    model.metadata_props[0].value = json.dumps(described)
    onnx.save(model, path)
    with pytest.raises(ControllerError, match=r"speed \(1\), scan \(54\).* observation is speed \(1\), scan \(20"):
        read_policy(path)
    del model.metadata_props[:]
    onnx.save(model, path)
    with pytest.raises(ControllerError, match="no 'fg_mujoco_policy' in its metadata_props"):
        read_policy(path)


def test_a_run_keeps_the_policy_that_drove_it(here):
    content = Path(written(here / "policy")).read_bytes()
    result = fg.race("oval", "policy", time_limit=0.3)
    fg.write_run(result, "run", picture=False)
    assert (here / "run" / "controller.onnx").read_bytes() == content
    written(here / "policy", seed=1)  # as training goes on
    other = fg.race("oval", "policy", time_limit=0.3)
    assert other.ctrl.tobytes() != result.ctrl.tobytes()
    summary = fg.read_run("run").summary
    planner = recorded_planner(summary, result.world.model, controller="run/controller.onnx", where="run")
    again = fg.race("oval", planner, time_limit=0.3)  # by the file in the run's folder
    assert again.ctrl.tobytes() == result.ctrl.tobytes()
    assert fg.replay("run").identical


@pytest.mark.skipif(not EXAMPLES.exists(), reason="not a checkout of the repository")
def test_the_examples_race(here, monkeypatch, capsys):
    """The policy that the example exports, and the bundled one, which was written as JSON before: its first actions."""
    pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
    pytest.importorskip("onnx", reason="onnx is not installed")
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    spec = importlib.util.spec_from_file_location("own_policy", EXAMPLES / "own_policy.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    monkeypatch.setattr("sys.argv", ["own_policy.py", "--out", "own.onnx"])
    example.main()
    assert "1 of 1 laps" in capsys.readouterr().out
    own = read_policy("own.onnx")
    seen = np.linspace(-1.0, 1.0, 6, dtype=np.float32)
    by_hand = np.dot(example.STEERING, seen), np.dot(example.SPEED, seen) + 1.0
    np.testing.assert_allclose(own.act(seen), by_hand, atol=1e-6)
    racer = read_policy(EXAMPLES / "policies/racer.onnx")
    seen = np.linspace(-1.0, 1.0, 400, dtype=np.float32)
    np.testing.assert_allclose(racer.act(seen), (0.94742477, -1.0309787), atol=1e-6)
    assert fg.race("oval", str(racer.path), laps=1, time_limit=30.0).cars[0].end_reason == "finished"
