"""Opens the only camera that there is with iniVation's dv-processing, and prints sums over the first 2, 4, 8 and so on events,
in the form in which `hil-sim serve` prints those that it sent.

usage: dv_camera.py EVENTS
"""

import sys
import time

import dv_processing as dv
import numpy

# How long the events may take to come.
PATIENCE_S = 120


def main() -> None:
    wanted = int(sys.argv[1])
    for found in dv.io.camera.discover():
        print("found", found.cameraModel, found.serialNumber)
    camera = dv.io.camera.open()
    print("opened", camera.getCameraName(), camera.getEventResolution())
    columns = {name: numpy.zeros(0, dtype=numpy.int64) for name in ("t", "x", "y", "p")}
    end = time.monotonic() + PATIENCE_S
    while len(columns["t"]) < wanted:
        if time.monotonic() > end:
            raise SystemExit(f"only {len(columns['t'])} events")
        batch = camera.getNextEventBatch()
        if batch is None or batch.size() == 0:
            time.sleep(0.005)
            continue
        events = batch.numpy()
        new = {"t": events["timestamp"], "x": events["x"], "y": events["y"], "p": events["polarity"]}
        for name, values in new.items():
            columns[name] = numpy.concatenate([columns[name], values.astype(numpy.int64)])
    # Its times count from the computer's clock at the camera's reset.
    columns["t"] -= columns["t"][0]
    count = 2
    while count <= wanted:
        sums = {name: int(values[:count].sum()) for name, values in columns.items()}
        print(f"tally: {count} events, {sums['p']} on, x {sums['x']}, y {sums['y']}, t since the first {sums['t']}")
        count *= 2


if __name__ == "__main__":
    main()
