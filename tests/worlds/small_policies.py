"""Small policies of random weights, for the tests of policy files."""

from functools import cache

import numpy as np

import fg_mujoco as fg
from fg_mujoco.addons.learn.onnx_policy import with_description
from fg_mujoco.addons.learn.perceptron import Layer, Normaliser, Perceptron
from fg_mujoco.addons.learn.policy_files import description_of
from fg_mujoco.addons.learn.policy_shapes import observed_shapes
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.policy_interface import PolicyInterface

FLAT = {"observation": "beams:54:max=10,speed,steering,previous_action,history:2,normalised,flat",
        "normalised_actions": True, "action": "steering_rate,acceleration", "speed_range": (0.5, 6.0),
        "action_repeat": 2, "smoothing": 0.05}  # fmt: skip
PARTS = {"observation": "speed,beams:54,yaw_rate", "speed_range": (0.5, 6.0)}


@cache
def _world():
    return fg.World("oval")


def interface_of(**settings):
    beams = _world().vehicle.lidar.beams
    return PolicyInterface.of(EnvironmentSettings.of(settings), _world().parameters, beams, beams.period)


def network_for(interface, *, hidden=8, activation="tanh", seed=0, normalised=False):
    """A network of two layers that takes the interface's observation; it turns to and fro and drives slowly."""
    rng = np.random.default_rng(seed)
    width = sum(int(np.prod(shape)) for shape in observed_shapes(interface).values())
    weights = rng.normal(size=(hidden, width)) / width**0.5
    first = Layer(weights=weights, bias=np.zeros(hidden), activation=activation)
    second = Layer(weights=0.1 * rng.normal(size=(2, hidden)), bias=(0.05, 0.1))
    mean, std = rng.normal(size=width), rng.uniform(0.5, 2.0, width)
    normaliser = Normaliser(mean=mean, std=std, clip=3.0) if normalised else None
    return Perceptron(layers=(first, second), normaliser=normaliser)


def write_onnx(network, path, interface, trained):
    """Write a network as ONNX, as torch's exporter writes one: the parts of an observation are its inputs."""
    import onnx

    helper, real = onnx.helper, onnx.TensorProto.FLOAT
    shapes = observed_shapes(interface)
    nodes, constants = [], []

    def add(kind, *taken, **attributes):
        names = [each if isinstance(each, str) else f"constant_{len(constants) + i}" for i, each in enumerate(taken)]
        own = {name: each for each, name in zip(taken, names, strict=True) if each is not name}
        constants.extend(onnx.numpy_helper.from_array(np.asarray(own[name], np.float32), name) for name in own)
        nodes.append(helper.make_node(kind, names, [f"made_{len(nodes)}"], **attributes))
        return nodes[-1].output[0]

    now = add("Concat", *(add("Flatten", name, axis=1) for name in shapes), axis=1)
    if network.normaliser is not None:
        own = network.normaliser
        now = add("Clip", add("Div", add("Sub", now, own.mean), own.std), -own.clip, own.clip)
    for layer in network.layers:
        now = add("Gemm", now, layer.weights, layer.bias, transB=1)
        now = now if layer.activation == "none" else add(layer.activation.capitalize(), now)
    nodes.append(helper.make_node("Identity", [now], ["action"]))
    inputs = [helper.make_tensor_value_info(name, real, ["n", *shape]) for name, shape in shapes.items()]
    output = helper.make_tensor_value_info("action", real, ["n", 2])
    graph = helper.make_graph(nodes, "policy", inputs, [output], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    path.write_bytes(with_description(model, description_of(interface, trained)))
    return path
