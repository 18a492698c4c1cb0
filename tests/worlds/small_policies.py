"""Small policies of random weights, for the tests of policy files."""

from functools import cache

import numpy as np
import pytest

import fg_mujoco as fg
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


def weights_for(interface, seed=0):
    """Arrays of two layers behind a normaliser, which take the interface's observation; the car drives slowly."""
    rng = np.random.default_rng(seed)
    width = sum(int(np.prod(shape)) for shape in observed_shapes(interface).values())
    found = {"mean": rng.normal(size=width), "std": rng.uniform(0.5, 2.0, width),
             "first": rng.normal(size=(8, width)) / width**0.5, "second": 0.1 * rng.normal(size=(2, 8)),
             "bias": np.array((0.05, 0.1))}  # fmt: skip
    return {name: array.astype(np.float32) for name, array in found.items()}


def network_for(interface, *, seed=0, gain=1.0):
    """An ONNX model of these weights, whose actions are times `gain`, as torch's exporter writes one."""
    onnx = pytest.importorskip("onnx", reason="onnx is not installed")
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    node, value, real = onnx.helper.make_node, onnx.helper.make_tensor_value_info, onnx.TensorProto.FLOAT
    shapes, arrays = observed_shapes(interface), weights_for(interface, seed) | {"least": np.array(-3.0, np.float32)}
    arrays |= {"most": np.array(3.0, np.float32), "gain": np.array(gain, np.float32)}
    nodes = [
        *(node("Flatten", [name], [f"flat_{name}"], axis=1) for name in shapes),
        node("Concat", [f"flat_{name}" for name in shapes], ["seen"], axis=1),
        node("Sub", ["seen", "mean"], ["moved"]), node("Div", ["moved", "std"], ["scaled"]),
        node("Clip", ["scaled", "least", "most"], ["clipped"]),
        node("Gemm", ["clipped", "first"], ["hidden"], transB=1), node("Tanh", ["hidden"], ["bent"]),
        node("Gemm", ["bent", "second", "bias"], ["mean_action"], transB=1),
        node("Mul", ["mean_action", "gain"], ["action"]),
    ]  # fmt: skip
    inputs = [value(name, real, ["n", *shape]) for name, shape in shapes.items()]
    constants = [onnx.numpy_helper.from_array(array, name) for name, array in arrays.items()]
    graph = onnx.helper.make_graph(nodes, "policy", inputs, [value("action", real, ["n", 2])], constants)
    return onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=9)
