"""Servers that a race answers: `foxglove_server`, `rosbridge`, and `autodrive` for DevKits of AutoDRIVE."""
