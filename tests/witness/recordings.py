"""Reads files that evfocus-record wrote with other people's libraries and compares every event.

Usage: recordings.py CONVERT DATA WORK, where CONVERT is the example of evfocus-record that converts recordings, DATA its
folder of real recordings, and WORK an empty folder. `run` beside this file calls it.
"""

import logging
import subprocess
import sys
from pathlib import Path

import numpy

logging.disable(logging.WARNING)

# Times are written from the last multiple of this before the first event on; a header line says what to add.
EVT3_PERIOD_US = 1 << 24
# Events in an order that no writer may change: equal times, descending columns, runs for vectors, long silences.
MADE_EVENTS = 20_000
MADE_SENSOR = (640, 480)
# Events that dv-processing writes with each of its compressions.
DV_EVENTS = 30_000

COLUMNS = ("t", "x", "y", "p")


def columns(t, x, y, p):
    """Events as four integer arrays."""
    return dict(zip(COLUMNS, (numpy.asarray(column).astype(numpy.int64) for column in (t, x, y, p))))


def read_csv(path):
    rows = numpy.loadtxt(path, delimiter=",", skiprows=1, dtype=numpy.int64)
    return columns(rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3])


def read_evt3(path):
    import evt3

    events = evt3.decode_file(str(path))
    return columns(events.timestamp, events.x, events.y, events.polarity)


def read_evlib(path):
    import evlib

    frame = evlib.load_events(str(path), sort=False).collect()
    t = frame["t"].dt.total_microseconds().to_numpy()
    return columns(t, frame["x"].to_numpy(), frame["y"].to_numpy(), frame["polarity"].to_numpy() > 0)


def read_dv(path):
    import dv_processing

    recording = dv_processing.io.MonoCameraRecording(str(path))
    batches = []
    while recording.isRunning():
        batch = recording.getNextEventBatch()
        if batch is None:
            break
        batches.append(batch.numpy())
    events = numpy.concatenate(batches)
    return columns(events["timestamp"], events["x"], events["y"], events["polarity"])


def difference(expected, found):
    """Where two recordings differ first, in words; empty if nowhere."""
    for name in COLUMNS:
        if len(expected[name]) != len(found[name]):
            return f"{len(found[name])} events instead of {len(expected[name])}"
    for name in COLUMNS:
        differing = numpy.flatnonzero(expected[name] != found[name])
        if differing.size:
            at = differing[0]
            return f"{name} of event {at} is {found[name][at]} instead of {expected[name][at]}"
    return ""


def write_made_events(path):
    random = numpy.random.default_rng(20220618)
    width, height = MADE_SENSOR
    t = 1_000_000
    rows = []
    while len(rows) < MADE_EVENTS:
        t += int(random.choice([0, 0, 0, 1, 17, 900, 5000]))
        if random.random() < 0.0005:
            t += EVT3_PERIOD_US + int(random.integers(EVT3_PERIOD_US))
        first, y, on = random.integers(width), random.integers(height), random.integers(2)
        length, step = random.integers(1, 50), random.choice([1, 2, -1])
        rows += [(t, first + step * i, y, on) for i in range(length) if 0 <= first + step * i < width]
    lines = [",".join(map(str, row)) for row in rows]
    # The size of the sensor stands in the names of the columns.
    path.write_text(f"t_us,x@{width},y@{height},p\n" + "\n".join(lines) + "\n")


def write_evt2(path, events):
    """Events as EVT 2.0 words, which evfocus reads but does not write: a TIME_HIGH before each event is allowed."""
    t, x, y, p = (events[name].astype(numpy.uint32) for name in COLUMNS)
    words = numpy.empty(2 * len(t), dtype="<u4")
    words[0::2] = 0x8 << 28 | t >> 6
    words[1::2] = p << 28 | (t & 0x3F) << 22 | x << 11 | y
    width, height = MADE_SENSOR
    header = f"% evt 2.0\n% format EVT2;height={height};width={width}\n% geometry {width}x{height}\n% end\n"
    path.write_bytes(header.encode() + words.tobytes())


def write_dv(path, events, compression):
    """The first events, written by iniVation's library."""
    import dv_processing

    config = dv_processing.io.MonoCameraWriter.Config("DAVIS346_00000002")
    config.compression = getattr(dv_processing.CompressionType, compression)
    config.addEventStream((346, 260))
    writer = dv_processing.io.MonoCameraWriter(str(path), config)
    store = dv_processing.EventStore()
    for t, x, y, p in zip(*(events[name].tolist() for name in COLUMNS)):
        store.push_back(t, x, y, bool(p))
    writer.writeEvents(store)


def main():
    convert, data, work = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    made = work / "made.csv"
    write_made_events(made)
    originals = [
        data / "evt3_hd_1280x720_trigger.raw",
        data / "evt3_vga_640x480_trigger.raw",
        data / "davis346_events.aedat4",
        made,
    ]
    # How each library's reading of the original itself compares with ours, where it can read it.
    readers = {".raw": {"evt3": read_evt3, "evlib": read_evlib}, ".aedat4": {"dv-processing": read_dv}, ".csv": {}}
    failures = 0

    def check(what, expected, reader, path):
        nonlocal failures
        try:
            found = difference(expected, reader(path))
        except Exception as error:  # Whatever a library throws at a file of ours is a failure to report.
            found = f"{type(error).__name__}: {error}"
        failures += bool(found)
        print(f"{'FAILED' if found else 'ok'}  {what}: {found or str(len(expected['t'])) + ' events equal'}", flush=True)

    for original in originals:
        def converted(suffix):
            output = work / (original.stem + ".written" + suffix)
            subprocess.run([convert, original, output], check=True)
            return output

        ours = read_csv(converted(".csv"))
        for name, reader in readers[original.suffix].items():
            check(f"{original.name}, read by us and by {name}", ours, reader, original)
        from_period = dict(ours, t=ours["t"] - ours["t"][0] // EVT3_PERIOD_US * EVT3_PERIOD_US)
        raw, aedat4 = converted(".raw"), converted(".aedat4")
        for name, reader in readers[".raw"].items():
            check(f"{original.name}, written by us as EVT3, read by {name}", from_period, reader, raw)
        for name, reader in readers[".aedat4"].items():
            check(f"{original.name}, written by us as AEDAT4, read by {name}", ours, reader, aedat4)
    written = read_csv(made)
    evt2 = work / "made.evt2.raw"
    write_evt2(evt2, written)
    subprocess.run([convert, evt2, work / "made.evt2.csv"], check=True)
    ours = read_csv(work / "made.evt2.csv")
    check("made.evt2.raw, read by us, against what was written", written, lambda _: ours, evt2)
    check("made.evt2.raw, read by us and by evlib", ours, read_evlib, evt2)
    davis = {name: column[:DV_EVENTS] for name, column in read_csv(work / "davis346_events.written.csv").items()}
    for compression in ("NONE", "LZ4", "LZ4_HIGH", "ZSTD", "ZSTD_HIGH"):
        dv = work / f"dv.{compression}.aedat4"
        write_dv(dv, davis, compression)
        subprocess.run([convert, dv, work / "dv.csv"], check=True)
        check(f"AEDAT4 {compression}, written by dv-processing, read by us", davis, lambda _: read_csv(work / "dv.csv"), dv)
    if failures:
        sys.exit(f"{failures} checks failed")


if __name__ == "__main__":
    main()
