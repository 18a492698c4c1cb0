"""Maps and runs from bags: where the LiDAR was at each scan, what it saw from there, and the files of it.

`poses` says where the LiDAR was, `scan_matching` corrects poses that drift, `ray_model` turns scans into free and
occupied cells, and `recorded_map` writes them as a map that `--track` loads.
"""
