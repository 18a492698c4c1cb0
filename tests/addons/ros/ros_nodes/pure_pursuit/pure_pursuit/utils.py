import csv

import numpy as np


def load_waypoints(path):
    with open(path) as f:
        rows = [row for row in csv.reader(f) if row and not row[0].startswith('#')]
    return np.array(rows, dtype=float)[:, :2]
