"""Another experiment of the friction lab, so that there are two."""

from fg_mujoco.lab.experiment import Section


class Cubes:
    name = "cubes"
    title = "Cubes"

    def cells(self, settings):
        return [{"number": number} for number in range(2)]

    def measure(self, cell, settings):
        return [{"side_m": 1.0 * cell["number"], "volume_m3": 1.0 * cell["number"] ** 3}] * 20

    def section(self, rows, settings):
        return Section(sentences=(f"{len(rows)} cubes.",), columns={"side": "side_m", "volume": "volume_m3"})


EXPERIMENT = Cubes()
