"""Clones a planner: a small convolutional network learns from the scans and commands of `gap_finder`, in minutes.

    pip install -e '.[train]'
    python examples/clone_planner.py --out clone.onnx
    fg-mujoco race --track random:1001 --controller clone.onnx --laps 3

First `gap_finder` drives random courses, from starts anywhere, at an angle and beside the centreline, and the rollout
records what it sees and commands. The network learns to answer the same (behaviour cloning). Then, in each round, the
clone and the planner drive in turns (`InTurns`): the clone leads the car to where its own mistakes lead, and the
planner shows the way back. Of these drives the network learns the planner's turns only.

With `--out clone.npz` it writes the weights only, which the class `Clone` races with, without onnxruntime:
`--controller 'examples/clone_planner.py:Clone[weights=clone]'`.

The network sees every tenth beam and the speed. It is not told the friction, and the planner was told the same one in
all worlds, `--planner-mu`: a policy cannot learn to drive by a number that it does not see. The clone has no friction
limiter, safety filter or memory of its own. So it laps circuits, and no tight courses, on which `gap_finder` needs the
memory of its guidance.

Source of the turns: Ross, Gordon and Bagnell, "A Reduction of Imitation Learning and Structured Prediction to No-Regret
Online Learning", 2011, whose DAgger asks the expert about each state that the learner visits.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fg_mujoco as fg
from fg_mujoco.errors import FgMujocoError, MissingExtraError, missing_extra

STEP = 10  # every how many-th beam is seen: 109 of 1081
CONVOLUTIONS = ((1, 16, 7, 3), (16, 32, 5, 2), (32, 32, 3, 2))  # channels in and out, width, stride
HIDDEN = 64
STEERING_SCALE, SPEED_SCALE = 0.2, 4.0  # [rad], [m/s]
FASTEST = 8.0  # [m/s] that `gap_finder` drives, and the clone may
SLOWEST = 0.1  # [m/s] a slower command stops or goes back, which takes a memory to do
LOST_TICKS = 40  # before a crash: what the planner did then is no example
CLONE_TICKS, EXPERT_TICKS = 40, 30  # of a turn: 1 s and 0.75 s
Values = NDArray[np.float32]
Weights = dict[str, Values]


def answer(weights: Weights, scan: Values, speed: float) -> tuple[float, float]:
    """Return the steering angle [rad] and the speed [m/s] that the network commands.

    Args:
      weights: by the names of `network`.
      scan: (beams,) [m].
      speed: of the car [m/s].
    """
    found = (scan / (1.0 + scan))[np.newaxis]
    for layer, (_, _, width, stride) in enumerate(CONVOLUTIONS):
        windows = np.lib.stride_tricks.sliding_window_view(found, width, axis=1)[:, ::stride]  # (in, places, width)
        kernels, bias = weights[f"convolution_{layer}.weight"], weights[f"convolution_{layer}.bias"]
        found = np.maximum(np.tensordot(kernels, windows, axes=((1, 2), (0, 2))) + bias[:, np.newaxis], 0.0)
    seen = np.append(found.ravel(), np.float32(speed / SPEED_SCALE))
    hidden = np.maximum(weights["hidden.weight"] @ seen + weights["hidden.bias"], 0.0)
    steering, faster = (weights["command.weight"] @ hidden + weights["command.bias"]).tolist()
    return STEERING_SCALE * steering, SPEED_SCALE * faster


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the planner."""

    weights: str = "clone"  # the file that `--out` wrote, without its ending
    expert: str = "gap_finder"  # that takes turns with it


class Clone:
    """The network as a planner: for `fg-mujoco race`, and for the car. It needs numpy only."""

    Settings = Settings

    def __init__(self, settings: Settings, max_speed) -> None:
        self.max_speed = max_speed
        file = Path(settings.weights).with_suffix(".npz")
        self.files = [file]  # a comparison or a rollout that is gone on with asks whether it is the same file
        with np.load(file) as stored:
            self.weights: Weights = dict(stored)

    def reset(self) -> None:
        """Nothing to forget."""

    def __call__(self, scan, odometry) -> fg.DriveCommand:
        """Return the command for what is seen."""
        ranges = scan.ranges[len(scan.ranges) // 2 % STEP :: STEP]
        ranges = np.nan_to_num(ranges, nan=0.0, posinf=scan.range_max, neginf=0.0).astype(np.float32)
        steering, speed = answer(self.weights, ranges, odometry.speed)
        return fg.DriveCommand(steering_angle=steering, speed=min(max(speed, 0.0), self.max_speed))


class InTurns:
    """The clone and the planner that it learns from, in turns; worlds of an odd seed begin with the planner."""

    Settings = Settings

    def __init__(self, settings: Settings, car, mu, max_speed, seed) -> None:
        self.clone = Clone(settings, max_speed)
        self.files = self.clone.files
        self.expert = fg.make_controller(settings.expert, car=car, mu=mu, max_speed=max_speed)
        self.seed = seed
        self.reset()

    def reset(self) -> None:
        """Forget everything, as both do."""
        self.expert.reset()
        self.tick = 0

    def __call__(self, scan, odometry) -> fg.DriveCommand:
        """Return the command of the one whose turn it is; the planner sees all scans."""
        shown = self.expert(scan, odometry)
        self.tick += 1
        return shown if in_turn(self.seed, self.tick - 1) else self.clone(scan, odometry)


def in_turn(seed: int, tick: Any) -> Any:
    """Return whether it is the planner's turn at a tick, or at each of some ticks."""
    return (tick + (CLONE_TICKS if seed % 2 else 0)) % (CLONE_TICKS + EXPERT_TICKS) >= CLONE_TICKS


@dataclass(frozen=True, kw_only=True, eq=False)
class Examples:
    """What the network learns from: scans (n, beams) [m], speeds (n, 1) [m/s] and commands (n, 2) [rad, m/s]."""

    scans: Values
    speeds: Values
    commands: Values

    @classmethod
    def of(cls, dataset: fg.Dataset, keep: Callable[[int, Any], Any] | None = None) -> Examples:
        """Return the examples of a dataset.

        Args:
          dataset: that was recorded.
          keep: says for a world's seed which of its ticks count; None: all.
        """
        parts = []
        for episode in dataset:
            chosen = episode.commands[:, 1] > SLOWEST
            if episode.end_reason == "crash":
                chosen[-LOST_TICKS:] = False
            chosen &= True if keep is None else keep(episode.seed, np.arange(len(episode)))
            parts.append((episode.scans[chosen], episode["speed"][chosen, np.newaxis], episode.commands[chosen]))
        scans, speeds, commands = (np.concatenate(each) for each in zip(*parts, strict=True))
        return cls(scans=scans, speeds=speeds, commands=commands)

    def __add__(self, other: Examples) -> Examples:
        pairs = {name: (values, getattr(other, name)) for name, values in vars(self).items()}
        return Examples(**{name: np.concatenate(pair) for name, pair in pairs.items()})

    def mirrored(self) -> Examples:
        """Return the same, left for right."""
        other = np.array([-1, 1], np.float32)
        return Examples(scans=self.scans[:, ::-1], speeds=self.speeds, commands=self.commands * other)


def require_torch() -> Any:
    """Return torch.

    Raises:
      MissingExtraError: it is not installed; the message has the command that installs it.
    """
    try:
        import torch
    except ImportError as error:
        raise missing_extra("training a clone needs torch", "train") from error
    return torch


def network(beams: int) -> Any:
    """Return the network as a torch module, which takes scans (n, beams) [m] and speeds (n, 1) [m/s]."""
    torch = require_torch()

    class Network(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            for layer, (taken, given, width, stride) in enumerate(CONVOLUTIONS):
                setattr(self, f"convolution_{layer}", torch.nn.Conv1d(taken, given, width, stride))
            places = beams
            for *_, width, stride in CONVOLUTIONS:
                places = (places - width) // stride + 1
            self.hidden = torch.nn.Linear(places * CONVOLUTIONS[-1][1] + 1, HIDDEN)
            self.command = torch.nn.Linear(HIDDEN, 2)

        def forward(self, scan, speed):
            found = (scan / (1.0 + scan)).unsqueeze(1)
            for layer in range(len(CONVOLUTIONS)):
                found = torch.relu(getattr(self, f"convolution_{layer}")(found))
            seen = torch.cat((found.flatten(1), speed / SPEED_SCALE), dim=1)
            return self.command(torch.relu(self.hidden(seen))) * torch.tensor([STEERING_SCALE, SPEED_SCALE])

    return Network()


def fit(
    examples: Examples, *, epochs: int, seed: int, weights: Weights | None = None, rate: float = 2e-3
) -> tuple[Weights, float]:
    """Return the weights of the trained network, and its loss in the last epoch.

    Args:
      examples: to be learned, and mirrored, too.
      epochs: how often each is seen.
      seed: of the first weights and of the order.
      weights: to begin with; None: random ones.
      rate: learning rate at the beginning; it falls to zero.
    """
    torch = require_torch()
    torch.set_num_threads(1)  # so small a network is no faster with more, and the same seed gives the same bits
    torch.manual_seed(seed)
    model = network(examples.scans.shape[1])
    if weights is not None:
        model.load_state_dict({name: torch.from_numpy(values) for name, values in weights.items()})
    whole = examples + examples.mirrored()
    scans, speeds, commands = map(torch.from_numpy, (whole.scans, whole.speeds, whole.commands))
    scale = torch.tensor([STEERING_SCALE, SPEED_SCALE])
    batch = 256
    steps = epochs * (len(scans) // batch)
    optimiser = torch.optim.Adam(model.parameters(), rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    mean = 0.0
    for _ in range(epochs):
        order, losses = torch.randperm(len(scans)), []
        for first in range(0, len(order) - batch + 1, batch):
            chosen = order[first : first + batch]
            wrong = (model(scans[chosen], speeds[chosen]) - commands[chosen]) / scale
            loss = torch.nn.functional.smooth_l1_loss(wrong, torch.zeros_like(wrong), beta=0.2)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            losses.append(float(loss.detach()))
        mean = float(np.mean(losses))
    return {name: values.numpy().copy() for name, values in model.state_dict().items()}, mean


def save(weights: Weights, path: Path) -> None:
    """Write a file that races: the weights (.npz), or a policy with all that it sees and answers (.onnx)."""
    if path.suffix == ".npz":
        np.savez(path, **weights)
        return
    from fg_mujoco.addons.learn.policy_files import save_policy
    from fg_mujoco.envs.gym_environment import F1TenthEnv

    env = F1TenthEnv(observation="scan,speed", beam_step=STEP, speed_range=(0.0, FASTEST))
    torch, beams = require_torch(), env.observation_space["scan"].shape[0]
    model = network(beams)
    model.load_state_dict({name: torch.from_numpy(values) for name, values in weights.items()})
    save_policy(model, path, env.policy_interface)
    env.close()


def drive(
    controller: str,
    tracks: Sequence[str],
    folder: Path,
    *,
    worlds: int,
    duration: float,
    planner_mu: float,
    seed: int,
    workers: int | None,
) -> fg.Dataset:
    """Return what a planner has seen and commanded in worlds that begin anywhere, aslant and beside the middle."""
    starts = {
        "start_s": (0.0, 100.0), "start_offset": (-0.4, 0.4), "start_heading": (-0.5, 0.5), "start_speed": (0.0, 4.0),
        "mu": (0.8, 1.1), "lidar_noise": (0.0, 0.02),
    }  # fmt: skip
    fg.rollout(
        list(tracks), controller, n=worlds, time_limit=duration, planner_mu=planner_mu, randomize=starts, seed=seed,
        record=f"scans:{STEP}", out=folder, workers=workers,
    )  # fmt: skip
    return fg.read_dataset(folder)


def train(
    tracks: Sequence[str],
    folder: Path,
    *,
    expert: str = "gap_finder",
    worlds: int = 400,
    duration: float = 8.0,
    rounds: int = 1,
    epochs: int = 6,
    planner_mu: float = 0.7,
    seed: int = 1,
    workers: int | None = None,
    watch: Callable[[str], None] = lambda text: None,
) -> Weights:
    """Return the weights of a clone of a planner.

    Args:
      tracks: that it drives on.
      folder: for the datasets, empty.
      expert: the planner, a bundled one.
      worlds: of the first dataset, and of each round.
      duration: of each world [s].
      rounds: of drives in turns.
      epochs: of training, after each dataset.
      planner_mu: friction that the planner is told.
      seed: of all that is random.
      workers: threads of the rollouts.
      watch: told what has been done.
    """
    options: dict[str, Any] = {
        "worlds": worlds, "duration": duration, "planner_mu": planner_mu, "workers": workers
    }  # fmt: skip
    began = time.monotonic()
    examples = Examples.of(drive(expert, tracks, folder / "expert", seed=seed, **options))
    weights, loss = fit(examples, epochs=epochs, seed=seed)
    watch(f"{time.monotonic() - began:5.0f} s  {len(examples.scans):7d} examples  loss {loss:.4f}")
    for number in range(1, rounds + 1):
        file = folder / f"round{number}.npz"
        np.savez(file, **weights)
        in_turns = f"{Path(__file__).resolve()}:InTurns[weights={file.with_suffix('')},expert={expert}]"
        dataset = drive(in_turns, tracks, folder / f"round{number}", seed=seed + number, **options)
        crashes = int((dataset.worlds["end_reason"] == "crash").sum())
        examples += Examples.of(dataset, in_turn)
        weights, loss = fit(examples, epochs=epochs, seed=seed)
        done = f"{time.monotonic() - began:5.0f} s  {len(examples.scans):7d} examples  loss {loss:.4f}"
        watch(f"{done}  {crashes} of {len(dataset)} drives in turns crashed")
    return weights


def main() -> None:
    """Record, train, and write the clone."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--expert", default="gap_finder", help="the planner, a bundled one")
    parser.add_argument("--tracks", type=int, default=60, help="how many random courses to learn from")
    parser.add_argument("--tight", type=int, default=20, help="how many tight ones besides")
    parser.add_argument("--worlds", type=int, default=400, help="in each round")
    parser.add_argument("--duration", type=float, default=8.0, help="of each world, in seconds")
    parser.add_argument("--rounds", type=int, default=1, help="in which the clone and the planner drive in turns")
    parser.add_argument("--epochs", type=int, default=6, help="of training, after each round")
    parser.add_argument("--planner-mu", type=float, default=0.7, help="friction that the planner is told")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, help="threads that drive; default: all cores")
    parser.add_argument("--data", type=Path, help="keep the datasets in this folder, which is new or empty")
    parser.add_argument("--out", type=Path, default=Path("clone.onnx"), help="a .npz or .onnx file")
    options = parser.parse_args()
    if options.out.suffix not in (".npz", ".onnx"):
        parser.error(f"--out {options.out}; accepted: a file that ends in .npz or .onnx")
    if not options.out.absolute().parent.is_dir():
        parser.error(f"--out {options.out}: no such folder; accepted: a file in a folder that exists")
    tracks = [f"random:{number}" for number in range(options.tracks)]
    tracks += [f"random:{number}:tight" for number in range(options.tight)] + ["oval", "hairpins", "chicanes"]
    with tempfile.TemporaryDirectory() as temporary:
        try:
            require_torch()
            weights = train(
                tracks, options.data or Path(temporary), expert=options.expert, worlds=options.worlds,
                duration=options.duration, rounds=options.rounds, epochs=options.epochs,
                planner_mu=options.planner_mu, seed=options.seed, workers=options.workers,
                watch=lambda text: print(text, flush=True),
            )  # fmt: skip
        except MissingExtraError as error:
            parser.exit(2, f"{parser.prog}: {error}\n")
        except FgMujocoError as error:
            parser.error(str(error))
    save(weights, options.out)
    print(f"written: {options.out}")


if __name__ == "__main__":
    main()
