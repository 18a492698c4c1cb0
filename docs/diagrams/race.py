"""The picture in motion of the README: python docs/diagrams/race.py writes docs/images/race.webp (make picture).

Six seconds of chicanes from behind the identified car on its floor, with the trace, the tires' forces and the strip.
"""

from __future__ import annotations

from pathlib import Path

from PIL import Image

import fg_mujoco as fg
from fg_mujoco.pictures.rendering import Film, Overlays

PICTURE = Path(__file__).parent.parent / "images" / "race.webp"
SIZE = (640, 360)  # [px]
BEGIN, END, RATE = 14.6, 20.6, 10.0  # [s], [s], [1/s]


def main() -> None:
    """Drive the laps and write the picture."""
    race = fg.race("chicanes", vehicle="ipz", floor="ipz8", laps=2)
    with Film(race, size=SIZE, overlays=Overlays(trace=True, forces=True, strip=True)) as film:
        frames = [Image.fromarray(film.frame(BEGIN + index / RATE)) for index in range(round((END - BEGIN) * RATE))]
    frames[0].save(
        PICTURE, save_all=True, append_images=frames[1:], duration=round(1000.0 / RATE), loop=0, quality=50, method=6
    )


if __name__ == "__main__":
    main()
