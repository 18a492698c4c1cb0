"""Exports a policy of one's own as an ONNX file that races; here its weights are numpy arrays, chosen by hand.

    pip install -e '.[gym,policies]' onnx
    python examples/own_policy.py --out own.onnx
    fg-mujoco race --controller own.onnx --track oval

It sees five beams, from right to left, and its speed, steers to where there is more room, and slows down for what is
near. A network of torch goes to `save_policy` as it is, and so does a model of Stable-Baselines3; JAX and others export
an ONNX model of their own. All take each part of the observation by its name, (n, ...) float32, and return actions
(n, 2). `save_policy` writes the environment's interface beside them, so that the race gives what they were made for.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

import fg_mujoco as fg
from fg_mujoco.addons.learn.policy_files import read_policy, save_policy
from fg_mujoco.envs.gym_environment import F1TenthEnv

SEEN = "beams:5:max=10,speed,normalised,flat"
STEERING = [-0.1, -0.3, 0.0, 0.3, 0.1, 0.0]  # [rad] for each number that is seen
SPEED = [0.0, 0.5, 3.0, 0.5, 0.0, -0.5]  # [m/s]


def network() -> Any:
    """Return the policy as an ONNX model: action = observation times weights, plus bias."""
    import onnx

    value, real = onnx.helper.make_tensor_value_info, onnx.TensorProto.FLOAT
    arrays = {"weights": np.array([STEERING, SPEED], np.float32), "bias": np.array([0.0, 1.0], np.float32)}
    graph = onnx.helper.make_graph(
        [onnx.helper.make_node("Gemm", ["observation", "weights", "bias"], ["action"], transB=1)], "own",
        [value("observation", real, ["n", len(STEERING)])], [value("action", real, ["n", 2])],
        [onnx.numpy_helper.from_array(array, name) for name, array in arrays.items()],
    )  # fmt: skip
    return onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 18)], ir_version=9)


def main() -> None:
    """Write the policy, ask it once, and race it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", default="own.onnx")
    options = parser.parse_args()
    env = F1TenthEnv(track="oval", observation=SEEN, speed_range=(0.5, 5.0))
    path = save_policy(network(), options.out, env.policy_interface)
    observation, _ = env.reset(seed=1)
    print(observation, "->", read_policy(path).act(observation))
    print(fg.race("oval", str(path), laps=1))


if __name__ == "__main__":
    main()
