"""The example that clones a planner, in short form: it learns what was recorded, and races as a planner."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg

EXAMPLE = Path(__file__).parents[2] / "examples" / "clone_planner.py"
if not EXAMPLE.exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("clone_planner", EXAMPLE)
    module = sys.modules["clone_planner"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    del sys.modules["clone_planner"]


def straight(example, count=2048):
    """Examples whose command is a function of what is seen: steer to the side that is open."""
    rng = np.random.default_rng(1)
    right, left = rng.uniform(0.5, 5.0, (2, count, 1)).astype(np.float32)
    scans = np.where(np.arange(109) < 54, right, left)
    speeds = rng.uniform(0.0, 8.0, (count, 1)).astype(np.float32)
    steering = 0.05 * (scans[:, 80] - scans[:, 28])
    return example.Examples(
        scans=scans, speeds=speeds, commands=np.column_stack((steering, 0.5 * speeds[:, 0])).astype(np.float32)
    )


def test_without_torch_the_command_that_installs_it_is_named(tmp_path):
    code = f"import sys; sys.modules['torch'] = None; sys.argv = ['clone', '--data', {str(tmp_path / 'data')!r}]; "
    code += f"import runpy; runpy.run_path({str(EXAMPLE)!r}, run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "training a clone needs torch" in done.stderr and "[train]" in done.stderr


@pytest.mark.slow
def test_the_network_learns_and_the_planner_answers_as_it_does(example, tmp_path):
    pytest.importorskip("torch", reason="the extra train is not installed")
    examples = straight(example)
    (first, loss), (again, _) = (example.fit(examples, epochs=1, seed=1) for _ in range(2))
    assert all(first[name].tobytes() == again[name].tobytes() for name in first)
    weights, last = example.fit(examples, epochs=8, seed=1)
    assert last < 0.4 * loss
    import torch

    model = example.network(109)
    model.load_state_dict({name: torch.from_numpy(values) for name, values in weights.items()})
    with torch.no_grad():
        wanted = model(torch.from_numpy(examples.scans[:8]), torch.from_numpy(examples.speeds[:8])).numpy()
    found = [example.answer(weights, examples.scans[i], examples.speeds[i, 0]) for i in range(8)]
    np.testing.assert_allclose(found, wanted, atol=1e-5)

    example.save(weights, tmp_path / "clone.npz")
    source = f"{EXAMPLE}:Clone[weights={tmp_path / 'clone'}]"
    result = fg.race("oval", source, time_limit=0.3)
    assert result.car.end_reason == "time_limit"
    pytest.importorskip("onnxscript", reason="the extra train is not installed")
    pytest.importorskip("onnxruntime", reason="the extra policies is not installed")
    example.save(weights, tmp_path / "clone.onnx")
    other = fg.race("oval", str(tmp_path / "clone.onnx"), time_limit=0.3)
    for column in ("command_steering", "command_speed"):
        np.testing.assert_allclose(other.car.column(column), result.car.column(column), atol=1e-4)
