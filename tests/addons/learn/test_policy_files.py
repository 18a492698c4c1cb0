"""Policy files: what is written is read and drives with the same bits; what does not fit is refused in one line."""

import json
import math
from itertools import product

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from driven_environments import race_as_environment
from fg_mujoco.addons.learn.perceptron import ACTIVATIONS, Layer, Normaliser, Perceptron
from fg_mujoco.addons.learn.policy_files import read_policy, save_policy
from fg_mujoco.addons.learn.policy_shapes import observed_shapes
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.racing.resimulation import recorded_planner
from refusals import refused
from small_policies import FLAT, PARTS, interface_of, network_for, write_onnx


def written(path, settings=FLAT, **network):
    """A policy file of random weights, and its path as a text."""
    if path.suffix == ".onnx":
        pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
        pytest.importorskip("onnx", reason="onnx is not installed")
    interface = interface_of(**settings)
    write = write_onnx if path.suffix == ".onnx" else save_policy
    return str(write(network_for(interface, **network), path, interface, trained={"steps": 3}))


@each("activation", ACTIVATIONS)
def test_a_network_is_layers_of_weighted_sums_and_text_has_all_its_bits(activation):
    rng = np.random.default_rng(1)
    weights, bias = rng.normal(size=(5, 7)), rng.normal(size=5)
    layers = Layer(weights=weights, bias=bias, activation=activation), Layer(weights=np.eye(5), bias=np.zeros(5))
    normaliser = Normaliser(mean=np.full(7, 0.5), std=np.full(7, 2.0), clip=1.0)
    network = Perceptron(layers=layers, normaliser=normaliser)
    values = rng.normal(size=7).astype(np.float32) * 3.0
    inner = weights @ np.clip((values - 0.5) / 2.0, -1.0, 1.0) + bias
    by_hand = {"none": inner, "relu": np.where(inner > 0, inner, 0), "tanh": np.tanh(inner),
               "sigmoid": 1 / (1 + np.exp(-inner)), "elu": np.where(inner > 0, inner, np.exp(inner) - 1),
               "silu": inner / (1 + np.exp(-inner))}  # fmt: skip
    np.testing.assert_allclose(network(values), by_hand[activation], rtol=1e-5, atol=1e-6)
    again = Perceptron.read(json.loads(json.dumps(network.described())))
    assert again(values).tobytes() == network(values).tobytes()


def test_estimates_are_inputs_besides():
    """By hand; and a batch has the bits of its rows."""
    rng = np.random.default_rng(4)
    guess, act = rng.normal(size=(2, 5)), rng.normal(size=(3, 7))
    estimator = Perceptron(layers=(Layer(weights=guess, bias=np.ones(2), activation="tanh"),))
    layers, normaliser = (Layer(weights=act, bias=np.zeros(3)),), Normaliser(mean=np.ones(5), std=np.full(5, 2.0))
    network = Perceptron(layers=layers, normaliser=normaliser, estimator=estimator)
    values = rng.normal(size=(4, 5)).astype(np.float32)
    scaled = (values - 1.0) / 2.0
    by_hand = np.concatenate((scaled, np.tanh(scaled @ guess.T + 1.0)), axis=1) @ act.T
    np.testing.assert_allclose(network.of_each(values), by_hand, rtol=1e-4, atol=1e-5)
    again = Perceptron.read(json.loads(json.dumps(network.described())))
    assert again.of_each(values).tobytes() == np.array([network(row) for row in values]).tobytes()
    assert (network.inputs, network.outputs) == (5, 3)
    with pytest.raises(SettingsError, match="estimator of a network takes 5 numbers, the network 4 and 2 of it"):
        Perceptron(layers=(Layer(weights=act[:, 1:], bias=np.zeros(3)),), estimator=estimator)


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
def test_the_forms_hold_the_same_policy(settings, tmp_path):
    texts = [written(tmp_path / name, settings, normalised=True) for name in ("first", "second.onnx")]
    policies = [read_policy(text) for text in texts]
    shapes, rng = observed_shapes(policies[0].interface), np.random.default_rng(2)
    parts = {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}
    actions = [policy.act(parts if settings is PARTS else parts["observation"]) for policy in policies]
    np.testing.assert_allclose(actions[0], actions[1], atol=1e-6)
    for policy in policies:
        assert (policy.interface, policy.trained) == (interface_of(**settings), {"steps": 3})


@each("form, settings", product(("policy", "policy.onnx"), (FLAT, PARTS)))
def test_it_commands_in_a_race_what_it_commands_in_the_environment(form, settings, tmp_path):
    gym_environment = pytest.importorskip("fg_mujoco.envs.gym_environment")
    controller = written(tmp_path / form, settings)
    race_as_environment(gym_environment.F1TenthEnv(track="hairpins", start="line", **settings), controller, 40)


def changed(path, **changes):
    """Write a policy's file anew, with some of its values changed; keys of inner values have dots."""
    found = json.loads(path.read_text())
    for name, value in changes.items():
        *inner, last = name.split("__")
        place = found
        for key in inner:
            place = place[key]
        place[last] = value
    path.write_text(json.dumps(found))


@each("changes, said",
      [({"interface__beams__count": 541}, "trained with 541 beams from -135.0 to 135.0 deg, the car's LiDAR has 1081"),
       ({"interface__beams__count": 10**12}, "beams.count is 1000000000000; accepted: a whole number"),
       ({"interface__sensors": [{"name": "pose", "values": 10**12}]}, "sensors.values is 1000000000000; accepted"),
       ({"interface__period": 0.05}, "trained with a scan every 0.05 s, the car's LiDAR has one every 0.025 s"),
       ({"interface__observation": "speed,yaw_rate,beams:20"}, "takes 56 numbers, its observation has 22: speed (1)"),
       ({"interface__observation": "speed,mu,beams:54", "inputs": ["mu", "speed", "scan"]}, "mu, which a car does"),
       ({"interface__observation": "spede,beams:54"}, "did you mean 'speed'?"),
       ({"interface__period": None}, "period is None"),
       ({"format": "fg_mujoco policy 9"}, "its format is 'fg_mujoco policy 9'"),
       ({"network": {}}, "a network is damaged"),
       ({"network__normaliser": []}, "a network is damaged"),
       ({"interface__car__gravity": "g"}, "its interface is damaged"),
       ({"interface__beams__angle_min": math.nan}, "interface.beams.angle_min is nan"),
       ({"inputs": ["scan", "speed"]}, "takes ['scan', 'speed'], its observation is speed (1), scan (54), yaw_rate")])
def test_what_does_not_fit_is_refused_before_the_race(changes, said, tmp_path, capsys):
    path = tmp_path / "policy" / "policy.json"
    written(path, PARTS)
    changed(path, **changes)
    assert said in refused(tmp_path, capsys, "race", "--controller", str(path))


@each("name, content, said",
      [("policy.json", b"{", "is no JSON"),
       ("policy.json", b"[]", "its format is None"),
       ("policy.onnx", b"not one", "is no ONNX model"),
       ("policy.zip", b"not one", "is no zip file of Stable-Baselines3")])  # fmt: skip
def test_what_is_no_policy_file_is_refused(name, content, said, tmp_path, capsys):
    if name.endswith(".onnx"):
        pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    (tmp_path / name).write_bytes(content)
    assert said in refused(tmp_path, capsys, "race", "--controller", str(tmp_path / name))


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
    content = (here / written(here / "policy")).read_bytes()
    result = fg.race("oval", "policy", time_limit=0.3)
    fg.write_run(result, "run", picture=False)
    assert (here / "run" / "controller.json").read_bytes() == content
    written(here / "policy", seed=1)  # as training goes on
    other = fg.race("oval", "policy", time_limit=0.3)
    assert other.ctrl.tobytes() != result.ctrl.tobytes()
    summary = fg.read_run("run").summary
    planner = recorded_planner(summary, result.world.model, trust=False, where="run", folder=here / "run")
    again = fg.race("oval", planner, time_limit=0.3)  # by the file in the run's folder
    assert again.ctrl.tobytes() == result.ctrl.tobytes()
    assert fg.replay("run").identical
