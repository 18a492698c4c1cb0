"""The bundled scenes, each a function of a name, a seed and a car; `fg_mujoco.course.scenes` finds them by name.

`corridors`, `gap_widths` and `corners` make them; `parts` has the rooms, ways and mirror images that they are made of.
"""
