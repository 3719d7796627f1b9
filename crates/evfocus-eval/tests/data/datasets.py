"""Writes small data sets in the layouts of EAD and ELP, for tests/datasets.rs: `python3 datasets.py` with NumPy and SciPy.

Event i of a sequence: t = 1000 + 10 i us, x = 7 i mod 346, y = 11 i mod 260, p = i mod 2, lens position 220 + 5 i counts.
"""

from pathlib import Path

import numpy as np
from scipy.io import savemat

HERE = Path(__file__).parent
EVENTS = 300
i = np.arange(EVENTS)
T, X, Y, P, POSITION = 1000 + 10 * i, 7 * i % 346, 11 * i % 260, i % 2, 220 + 5 * i


def ead(name, types, **options):
    folder = HERE / "ead" / name
    folder.mkdir(parents=True, exist_ok=True)
    columns = dict(x=X, y=Y, polarity=P, timeStamp=T, focusPosition=POSITION)
    # MATLAB's vectors are columns.
    polarity = {key: values.astype(types[key]).reshape(-1, 1) for key, values in columns.items()}
    path = folder / "events.mat"
    savemat(path, {"aedat": {"data": {"polarity": polarity}}}, **options)
    # SciPy leaves out a comma of MATLAB's header, and tells the time, which would make each run's file another one.
    header = b"MATLAB 5.0 MAT-file, Platform: GLNXA64, Created on: Thu Jan  1 00:00:00 1970"
    path.write_bytes(header.ljust(116) + path.read_bytes()[116:])


def elp(name, array, info):
    folder = HERE / "elp" / name
    folder.mkdir(parents=True, exist_ok=True)
    np.save(folder / "event.npy", array)
    (folder / "info.txt").write_text(info)


every = lambda kind: dict.fromkeys(["x", "y", "polarity", "timeStamp", "focusPosition"], kind)
ead("light_static_doubles", every("f8"), do_compression=True)
whole = dict(x="u2", y="u2", polarity="u1", timeStamp="i8", focusPosition="i4")
ead("dark_shake_whole", whole, do_compression=False)
(HERE / "ead" / "gt_focus_points.txt").write_text("light_static 1234\ndark_shake\t987.5\n")

rows = np.stack([T, X, Y, P], axis=1)
within = "start_timestamp = 1100\nend_timestamp = 3500\ngt_timestamp = 2000\n"
elp("davis/doubles", rows.astype("f8"), within)
elp("davis/big-endian", rows.astype(">i4"), within)
# By columns: the reader must say so instead of mixing up its numbers.
elp("by-columns/one", np.asfortranarray(rows.astype("i8")), within)
records = np.zeros(EVENTS, dtype=[("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
records["t"], records["x"], records["y"], records["p"] = T, X, Y, P
elp("evk4/records", records, "ROI selected: 0 0 10 10\ngt_timestamp = 2500\n")
