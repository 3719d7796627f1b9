"""Runs a scenario in the virtual rig and judges by what the guest prints.

usage: rig.py SCENARIO --camera CAMERA [--root FOLDER --packages FOLDER] [--out FOLDER] [--bin FOLDER] [--seconds N]

The guest is a machine with Debian's stock kernel in QEMU, in software. Its time goes with its instructions (-icount) where it is
busy, so that a slow or busy host makes it take longer and not late. The emulated devices run in it too, so they live in the same
time: the camera reaches its USB stack over USB/IP, the lens by the kernel's serial gadget (g_serial), which the kernel's own loop
(dummy_hcd) plugs into it as the adapter (cdc_acm) that the daemon opens. Nothing of it passes QEMU, whose time is the host's;
only in the scenario `adapter` is it an adapter that QEMU emulates (ftdi_sio). Passes if the scenario finished in time with nothing failed; the transcript is
left in FOLDER/SCENARIO-CAMERA.log.
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
TARGET = HERE.parent.parent / "target"


def adapter(work: str) -> list[str]:
    """A USB serial adapter with FTDI's chip, whose other end is the second serial port; the first is the console."""
    ends = ["-chardev", f"socket,id=adapter,path={work}/lens,server=on,wait=off", "-chardev", f"socket,id=lens,path={work}/lens"]
    ends += ["-device", "isa-serial,chardev=lens,index=1", "-device", "qemu-xhci"]
    return [*ends, "-device", "usb-serial,chardev=adapter,always-plugged=on"]


def qemu(out: pathlib.Path, words: dict[str, object], memory: int, shift: int) -> list[str]:
    append = ["console=ttyS0 quiet panic=-1 mitigations=off noautogroup", *(f"rig.{key}={value}" for key, value in words.items())]
    if "root" in words:
        append += ["systemd.unit=multi-user.target", "systemd.wants=rig.service", "systemd.show_status=0"]
        append += [f"systemd.mask={unit}" for unit in ("serial-getty@ttyS0.service", "getty@tty1.service")]
    share = "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap"
    command = ["qemu-system-x86_64", "-M", "q35", "-accel", "tcg", "-icount", f"shift={shift},sleep=on", "-rtc", "clock=vm"]
    command += ["-cpu", "max", "-m", str(memory), "-nodefaults", "-nographic", "-no-reboot", "-virtfs", share]
    return [*command, "-serial", "stdio", "-kernel", str(out / "vmlinux"), "-initrd", str(out / "initrd"), "-append", " ".join(append)]


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("scenario")
    parser.add_argument("--camera", required=True)
    parser.add_argument("--out", type=pathlib.Path, default=TARGET / "rig")
    parser.add_argument("--bin", type=pathlib.Path, default=TARGET / "release")
    parser.add_argument("--root", type=pathlib.Path, help="a Debian system with systemd and udev that the guest is to start")
    parser.add_argument("--packages", type=pathlib.Path, help="where the packages are that are to be installed in it")
    parser.add_argument("--minutes", type=int, default=20, help="of the soak, in the guest's time")
    parser.add_argument("--seed", type=int, default=1, help="of the soak's accidents")
    parser.add_argument("--background", type=int, default=50_000, help="events a second in the soak besides those of the scene")
    parser.add_argument("--memory", type=int, default=1024, help="of the guest, MiB")
    parser.add_argument("--shift", type=int, default=0, help="an instruction takes 2 to the power of this, ns")
    parser.add_argument("--seconds", type=float, default=600, help="longest time of the guest")
    arguments = parser.parse_args()

    words = {
        "scenario": HERE / "guest" / arguments.scenario,
        "bin": arguments.bin.resolve(),
        "camera": arguments.camera,
        "witness": arguments.out / "witness/release",
        "python": sys.executable,
        "minutes": arguments.minutes,
        "seed": arguments.seed,
        "background": arguments.background,
    }
    if arguments.root:
        words |= {"root": arguments.root.resolve(), "packages": arguments.packages.resolve()}
    began = time.monotonic()
    transcript = []
    log = arguments.out / f"{arguments.scenario}-{arguments.camera}.log"
    with tempfile.TemporaryDirectory() as work, log.open("w", buffering=1) as kept:
        command = qemu(arguments.out, words, arguments.memory, arguments.shift)
        if arguments.scenario == "adapter":
            command += adapter(work)
        guest = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, errors="replace")
        watchdog = threading.Timer(arguments.seconds, guest.kill)
        watchdog.start()
        for line in guest.stdout:
            transcript.append(f"{time.monotonic() - began:7.2f}  {line.rstrip()}")
            print(transcript[-1], file=kept)
        guest.wait()
        watchdog.cancel()
    passed = any("finished, 0 failed" in line for line in transcript)
    # In one piece: others may run beside.
    transcript.append(f"{arguments.scenario} with {arguments.camera}: {'passed' if passed else 'FAILED'}; transcript in {log}")
    print("\n".join(transcript), flush=True)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
