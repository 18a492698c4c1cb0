"""Physics steps of MuJoCo with tires that have a law of ours.

`tire_patch` has the force of a tire, whose load is that of a spring and a damper under its lowest point; `tire_rows` is
what its force and the short steps of tires and drive read off a model. native/vehicle does all of it, and calls
MuJoCo's stages around the short steps, which native/vehicle/tire_solve.hpp explains.

The short steps are seen from the car, whose velocity turns the other way while it turns; `place_between` turns what it
gained. So a step is of the second order: at 5 ms the yaw rate follows the steering within .05 ms as it does at .25 ms.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from ..arguments import Suggesting
from ..messages import FloatArray
from ..native import core, mujoco_library
from .car import WHEELS
from .tire_rows import GearRows, TireRows, gear_row, peaks, steps_within, take_over, tire_rows
from .tires import tires_of

mujoco_library()  # which the core calls


class TireForces(Suggesting):
    """Steps a model by hand, the tires of its cars included; of the model `contact` as mujoco.mj_step does.

    The motor's power is limited here: mujoco.mj_step gives the full force at every speed. The model's own contacts of
    tires that have a law of ours are switched off.

    Args:
      prefix: of the car's names, or those of several cars, in their order in the model.

    Attributes:
      rows: of the tires, (cars x wheels,) of TIRE; without those of the model `contact`.
      mu: lateral peak of each of them [-], likewise; where all are of the model `contact`, of these. Live.
      steps: short ones in a physics step; None: as many as `steps_within` says. Can be set.

    Raises:
      ModelError: a time step that is too long for the tires.
    """

    def __init__(self, model: mujoco.MjModel, prefix: str | Sequence[str] = "") -> None:
        prefixes = (prefix,) if isinstance(prefix, str) else tuple(prefix)
        own = [name for name in prefixes if not tires_of(model, name).is_contact]
        self.rows: TireRows = np.concatenate([tire_rows(model, name) for name in own or prefixes[:1]])
        self.mu: FloatArray = np.concatenate([peaks(model, name) for name in own or prefixes])
        self.steps: int | None = None
        self._model = model
        for name in own:
            take_over(model, name)
        self._gears = np.concatenate([gear_row(model, name) for name in own or prefixes])
        if own:
            self._gears["first_tire"] = range(0, len(self.rows), len(WHEELS))
            self._divided: tuple[object, ...] = ()  # what `tire_steps` was worked out for

    def _meant(self, name: str) -> str | None:
        return {"apply": "step", "end": "step"}.get(name) or super()._meant(name)

    def begin(self, data: mujoco.MjData) -> None:
        """Let the tires be as they are drawn, and work out everything of the state, sensors too."""
        if len(self.rows):
            data.eq_active[:] = self._model.eq_active0
            data.userdata[:] = 0.0
        self.forward(data)

    def forward(self, data: mujoco.MjData) -> None:
        """Work out everything of the state, sensors and tires' forces too, in the place of mujoco.mj_forward."""
        if len(self.rows):
            self._step(data, False)
        else:
            mujoco.mj_forward(self._model, data)

    def step(self, data: mujoco.MjData) -> None:
        """Do one physics step, in the place of mujoco.mj_step."""
        if len(self.rows):
            self._step(data, True)
        else:
            core.step_on_contacts(self._model._address, data._address, self._gears)

    def run(self, data: mujoco.MjData, records: FloatArray, states: FloatArray) -> None:
        """Do a physics step for each row of two arrays, (steps, sensordata) and (steps, userdata), written to."""
        if len(self.rows):
            core.steps_on_tires(*self._arguments(data), records, states)
            return
        for record, state in zip(records, states, strict=True):
            self.step(data)
            record[:], state[:] = data.sensordata[: len(record)], data.userdata[: len(state)]

    def _step(self, data: mujoco.MjData, advance: bool) -> None:
        core.step_on_tires(*self._arguments(data), advance)

    def _arguments(self, data: mujoco.MjData) -> tuple[int, int, GearRows, TireRows, FloatArray]:
        """Return what the native functions take to step the model."""
        model = self._model
        timestep, wheels = float(model.opt.timestep), len(WHEELS)
        masses = model.body_mass.tobytes(), model.body_subtreemass.tobytes(), model.dof_M0.tobytes()
        divided = self.steps, timestep, self.rows.tobytes(), *masses
        if divided != self._divided:
            for car, gear in enumerate(self._gears):
                own = self.rows[wheels * car : wheels * (car + 1)]
                gear["tire_steps"] = self.steps or steps_within(model, own, timestep)
            self._divided = divided
        return model._address, data._address, self._gears, self.rows, self.mu.reshape(-1, wheels)
