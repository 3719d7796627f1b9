"""Runs a scenario in the virtual rig and judges by what the guest prints.

usage: rig.py SCENARIO --camera CAMERA [--root FOLDER --package DEB] [--out FOLDER] [--bin FOLDER] [--seconds N]

The guest is a machine with Debian's stock kernel in QEMU, in software. Its time goes with its instructions (-icount) where it is
busy, so that a slow or busy host makes it take longer and not late. The emulated devices run in it too, so they live in the same
time: the camera reaches its USB stack over USB/IP, the lens by a serial adapter that QEMU emulates (ftdi_sio), whose other
end is the guest's second serial port. Passes if the scenario finished in time with nothing failed; the transcript is
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


def qemu(out: pathlib.Path, words: dict[str, str], memory: int, shift: int, work: str) -> list[str]:
    append = ["console=ttyS0 quiet panic=-1 mitigations=off", *(f"rig.{key}={value}" for key, value in words.items())]
    if "root" in words:
        append += ["systemd.unit=multi-user.target", "systemd.wants=rig.service", "systemd.show_status=0"]
        append += [f"systemd.mask={unit}" for unit in ("serial-getty@ttyS0.service", "getty@tty1.service")]
    share = "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap"
    command = ["qemu-system-x86_64", "-M", "q35", "-accel", "tcg", "-icount", f"shift={shift},sleep=on", "-rtc", "clock=vm"]
    command += ["-cpu", "max", "-m", str(memory), "-nodefaults", "-nographic", "-no-reboot", "-virtfs", share]
    # The first serial port is the console, the second the other end of the USB serial adapter.
    command += ["-serial", "stdio", "-chardev", f"socket,id=adapter,path={work}/lens,server=on,wait=off"]
    command += ["-chardev", f"socket,id=lens,path={work}/lens", "-device", "isa-serial,chardev=lens,index=1"]
    command += ["-device", "qemu-xhci", "-device", "usb-serial,chardev=adapter,always-plugged=on"]
    return [*command, "-kernel", str(out / "vmlinux"), "-initrd", str(out / "initrd"), "-append", " ".join(append)]


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("scenario")
    parser.add_argument("--camera", required=True)
    parser.add_argument("--out", type=pathlib.Path, default=TARGET / "rig")
    parser.add_argument("--bin", type=pathlib.Path, default=TARGET / "release")
    parser.add_argument("--root", type=pathlib.Path, help="a Debian system with systemd and udev that the guest is to start")
    parser.add_argument("--package", type=pathlib.Path, help="the package that is to be installed in it")
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
    }
    if arguments.root:
        words |= {"root": arguments.root.resolve(), "package": arguments.package.resolve()}
    began = time.monotonic()
    transcript = []
    with tempfile.TemporaryDirectory() as work:
        command = qemu(arguments.out, words, arguments.memory, arguments.shift, work)
        guest = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, errors="replace"
        )
        watchdog = threading.Timer(arguments.seconds, guest.kill)
        watchdog.start()
        for line in guest.stdout:
            transcript.append(f"{time.monotonic() - began:7.2f}  {line.rstrip()}")
        guest.wait()
        watchdog.cancel()
    log = arguments.out / f"{arguments.scenario}-{arguments.camera}.log"
    log.write_text("\n".join(transcript) + "\n")
    passed = any("finished, 0 failed" in line for line in transcript)
    # In one piece: others may run beside.
    transcript.append(f"{arguments.scenario} with {arguments.camera}: {'passed' if passed else 'FAILED'}; transcript in {log}")
    print("\n".join(transcript), flush=True)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
