"""The scenes that have a name, each a function of a name, a seed and a car. `catalogue` lists them.

`corridors`, `gap_widths` and `corners` make them; `parts` has the rooms, ways and mirror images that they are made of.
"""
