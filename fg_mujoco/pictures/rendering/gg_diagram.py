"""The g-g diagram of a drive: the acceleration of the car along and across, in every tick, in the circle of mu g.

The accelerations are those of the accelerometer in the CoG, read again at the recorded states, so they are what the
tires must hold. Source of the diagram: Rice, "Measuring car-driver interaction with the g-g diagram", SAE 730018, 1973.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from ...messages import FloatArray
from ...racing.result import RaceResult, tires_model
from ...racing.run_folder import Run
from ...simulation.cars import CAR_PREFIX, car_prefixes
from ...simulation.physics import STATE
from ...vehicle.car import Car
from ...vehicle.tire_forces import TireForces
from ...vehicle.tire_slip import slides_above
from ..pages.figure_kit import ALERT, Target, picture
from .recorded_drive import Drive, read_drive


def accelerations(source: Drive | Run | RaceResult | str | Path) -> FloatArray:
    """Return the car's acceleration at the start of each tick, ahead and to the left. Shape (ticks, 2) [m/s^2].

    Raises:
      RunFolderError: a folder that is none of `race --out`.
    """
    drive = read_drive(source)
    model = mujoco.MjModel.from_xml_string(drive.xml)
    car, data, tires = Car(model, CAR_PREFIX), mujoco.MjData(model), TireForces(model, car_prefixes(model))
    result = np.empty((len(drive.ctrl), 2))
    for row, state, ctrl in zip(result, drive.states[:-1], drive.ctrl, strict=True):
        mujoco.mj_setState(model, data, state, STATE)
        data.ctrl[:] = ctrl
        tires.forward(data)
        row[:] = car.odometry(data).linear_acceleration[:2]
    return result


def gg_picture(source: Drive | Run | RaceResult | str | Path, path: Target) -> None:
    """Draw the g-g diagram of a drive as PNG: each tick in the colour of its speed, ticks that slide with a red rim.

    Raises:
      RunFolderError: a folder that is none of `race --out`.
      MissingExtraError: matplotlib is not installed; the message has the command that installs it.
      OSError: the file cannot be written.
    """
    from matplotlib.patches import Circle

    drive = read_drive(source)
    ahead, left = accelerations(drive).T
    least = slides_above(tires_model(drive.summary))
    speed, slides = drive.column("speed_m_s"), drive.sliding_speed > least
    gravity = -float(mujoco.MjModel.from_xml_string(drive.xml).opt.gravity[2])
    limit = float(drive.summary["mu"]) * gravity
    with picture(path, 6.2, 5.4) as figure:
        axes = figure.add_subplot()
        axes.grid(False)
        axes.axhline(0.0, color="0.85", linewidth=0.6, zorder=0)
        axes.axvline(0.0, color="0.85", linewidth=0.6, zorder=0)
        for share in (0.5, 1.0):
            axes.add_patch(
                Circle((0.0, 0.0), share * limit, fill=False, color="0.2" if share == 1.0 else "0.7", linewidth=0.9,
                       linestyle="-" if share == 1.0 else (0, (4, 3)))
            )  # fmt: skip
        order = np.argsort(speed)
        points = axes.scatter(
            left[order], ahead[order], c=speed[order], s=7.0, cmap="viridis", vmin=0.0, linewidths=0.0, zorder=2
        )
        if slides.any():
            axes.scatter(
                left[slides], ahead[slides], s=16.0, facecolors="none", edgecolors=ALERT, linewidths=0.7, zorder=3
            )
        reach = 1.12 * max(limit, float(np.abs(np.concatenate((ahead, left))).max(initial=0.0)))
        axes.set(xlim=(reach, -reach), ylim=(-reach, reach), aspect="equal")  # left is left
        axes.set(xlabel="acceleration to the left [m/s²]", ylabel="acceleration ahead [m/s²]")
        axes.annotate(
            f"μ g = {limit:.1f} m/s²", (-0.71 * limit, 0.71 * limit), xytext=(3, 3), textcoords="offset points"
        )
        figure.colorbar(points, label="speed [m/s]", shrink=0.85, pad=0.02)
        share = 100.0 * float(slides.mean()) if len(slides) else 0.0
        summary = drive.summary
        axes.set_title(
            f"{summary.get('track', '')}, {summary.get('controller', '')}: sliding in {share:.1f} % of the ticks"
        )
