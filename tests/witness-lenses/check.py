"""Programs by others against our emulated lens controllers, and our drivers against devices by others."""

import asyncio
import struct
import sys
import threading
import time

from peers import Bridge, Daemon, Emulator, IndiDriver, check, installed, until, wait


def moonlite():
    """INDI's driver for MoonLite focusers drives our model."""
    if not installed("indi_moonlite_focus"):
        return
    device = "MoonLite"
    with Emulator("moonlite") as emulator, IndiDriver("indi_moonlite_focus") as driver:
        driver.send(b"<getProperties version='1.7'/>\n")
        driver.wait("it introduces itself", rf"device=.{device}.\s+name=.CONNECTION.")
        driver.wait("it has a port", r"name=.DEVICE_PORT.")
        driver.set(device, "Text", "DEVICE_PORT", "PORT", emulator.address)
        driver.set(device, "Switch", "DEVICE_AUTO_SEARCH", "INDI_DISABLED", "On")
        driver.set(device, "Number", "POLLING_PERIOD", "PERIOD_MS", "50")
        driver.set(device, "Switch", "CONNECTION", "CONNECT", "On")
        # Its definition comes before its first question, and says 0.
        match = driver.wait("position", r"setNumberVector[^>]*ABS_FOCUS_POSITION.[^>]*>\s*<oneNumber[^>]*>\s*([\d.]+)")
        check("indi_moonlite_focus connects and reads the position", abs(float(match[1]) - 220) < 1, match[1])

        # The driver flushes its output before each command. A UART has sent it by then; a pseudo-terminal throws away what
        # has not been read, so that a command is lost now and then, and given again here.
        def insist(what, command, effect):
            for _ in range(30):
                driver.set(device, *command)
                if wait(effect, 2):
                    break
            check(what, effect(), emulator.glass)

        def goto(target):
            return "Number", "ABS_FOCUS_POSITION", "FOCUS_ABSOLUTE_POSITION", str(target)

        insist("it goes where it is sent", goto(1000), lambda: emulator.glass == 1000)
        # It does not pass on the last five steps.
        driver.wait("it reads where it went", r"setNumberVector[^>]*ABS_FOCUS_POSITION.[^>]*>\s*<oneNumber[^>]*>\s*(99[5-9]|1000)\s")
        insist("it goes the other way", goto(3700), lambda: emulator.glass > 1300)
        abort = "Switch", "FOCUS_ABORT_MOTION", "ABORT", "On"
        insist("it is stopped", abort, lambda: (emulator.stands(0.9) or 3700) < 3600)


def optotune():
    """`opto` drives our model of a Lens Driver."""
    import opto

    with Emulator("optotune") as emulator, opto.Opto(port=emulator.address) as lens:
        check("opto shakes hands and reads the firmware type", chr(lens.firmwaretype()) == "B")
        check("it reads the serial number", lens.serialnumber() == b"SIM00001", lens.serialnumber())
        check("it reads the largest current", abs(lens.current_max() - 292.84) < 0.01, lens.current_max())
        check("it reads the temperature", abs(lens.temp_reading() - 30) < 0.1, lens.temp_reading())
        full = lens.current_max()
        # Not with a line feed among its bytes: opto ends an answer there.
        for raw in (2000, 1001):
            lens.current(raw * full / 4095 + 0.01)
            check("it sets a current and reads it back", abs(lens.current() - raw * full / 4095) < 0.1, lens.current())
            check("the glass follows", abs(emulator.stands() - raw) <= 1, emulator.glass)
        lens.mode("focal")
        check("it changes the mode", lens.mode() == "focal")


def grbl():
    """`grbl-streamer` drives our model of a GRBL controller."""
    from grbl_streamer import GrblStreamer

    with Emulator("grbl") as emulator:
        seen = {}
        machine = GrblStreamer(lambda event, *data: seen.__setitem__(event, data))
        machine.setup_logging()
        machine.poll_interval = 0.05
        machine.cnect(emulator.address, 115200)
        try:
            until("it boots", lambda: "on_boot" in seen)
            machine.poll_start()
            until("it reports its state", lambda: machine.cmode == "Idle")
            check("grbl-streamer resets it and reads where it is", machine.cmpos[0] == 2.2, machine.cmpos)
            until("it reads the settings", lambda: any("$100=" in line for line in seen.get("on_read", ())) or machine.settings)
            machine.send_immediately("$J=G90 X10.000 F6000")
            until("it jogs", lambda: emulator.glass == 1000)
            until("it reads where it went", lambda: machine.cmpos[0] == 10 and machine.cmode == "Idle")
            check("it jogs to its target and reads that", True, machine.cmpos)
            machine.send_immediately("$J=G90 X35.000 F3000")
            until("it jogs on", lambda: emulator.glass > 1300)
            seen.pop("on_boot", None)
            machine.softreset()
            until("it hears of the alarm and the new start", lambda: "on_alarm" in seen and "on_boot" in seen)
            check("a reset in mid-move is ALARM:3", "ALARM:3" in seen["on_alarm"][0], seen["on_alarm"][0])
            standing = emulator.stands()
            check("the motor stands", 1300 < standing < 3400, standing)
            until("it is locked", lambda: machine.cmode == "Alarm")
            machine.killalarm()
            until("it is unlocked", lambda: machine.cmode == "Idle")
            machine.send_immediately("$J=G90 X10.000 F6000")
            until("it goes back by the count that it kept", lambda: emulator.glass == 1000)
            check("it is unlocked and goes back by the count that it kept", True, machine.cmpos)
        finally:
            machine.disconnect()


def firmata():
    """`pyfirmata2` drives our model of a board, a motor and a potentiometer."""
    import pyfirmata2

    # It gives an Arduino five seconds to boot, which the model does not need.
    pyfirmata2.pyfirmata2.BOARD_SETUP_WAIT_TIME = 0.5
    with Emulator("firmata") as emulator:
        board = pyfirmata2.Arduino(emulator.address)
        readings = []
        board.samplingOn(10)
        board.analog[0].register_callback(readings.append)
        board.analog[0].enable_reporting()
        until("readings", lambda: len(readings) > 10)
        check("pyfirmata2 reads the potentiometer", abs(readings[-1] * 4095 - 220) < 5, readings[-1])
        board.sp.write(b"\xf9")
        until("it is told the version", lambda: board.firmata_version == (2, 5))
        direction, speed = board.get_pin("d:4:o"), board.get_pin("d:3:p")
        direction.write(1)
        speed.write(0.5)
        until("the motor runs up", lambda: readings[-1] * 4095 > 1000)
        speed.write(0)
        standing = emulator.stands()
        check("it runs the motor up and stops it", 1000 < standing < 3000, standing)
        until("the reading follows", lambda: abs(readings[-1] * 4095 - standing) < 5)
        direction.write(0)
        speed.write(0.4)
        until("the motor runs down", lambda: readings[-1] * 4095 < standing - 200)
        speed.write(0)
        check("it runs the motor down", emulator.stands() < standing - 200, emulator.glass)
        board.exit()


def labjack_model():
    """`pymodbus` as a client of our model of a LabJack."""
    from pymodbus.client import ModbusTcpClient

    with Emulator("labjack") as emulator:
        host, port = emulator.address.rsplit(":", 1)
        client = ModbusTcpClient(host, port=int(port))
        check("pymodbus connects", client.connect())

        def value(register, kind):
            answer = client.read_holding_registers(register, count=2)
            check(f"it reads register {register}", not answer.isError())
            return client.convert_from_registers(answer.registers, kind)

        kinds = client.DATATYPE
        check("the test register is right", value(55100, kinds.UINT32) == 0x00112233)
        check("it is a T7", value(60000, kinds.FLOAT32) == 7)
        volts = value(0, kinds.FLOAT32)
        check("the potentiometer is read", abs(volts / 5 * 4095 - 220) < 2, volts)
        outputs = [client.convert_to_registers(volts, kinds.FLOAT32) for volts in (2.5, 5.0)]
        check("the outputs are set", not client.write_registers(1000, outputs[0] + outputs[1]).isError())
        until("the motor runs", lambda: emulator.glass > 1000)
        client.write_registers(1000, client.convert_to_registers(0.0, kinds.FLOAT32))
        check("the motor stops", emulator.stands() < 3700, emulator.glass)
        answer = client.read_holding_registers(9999, count=2)
        check("a register that is not there is refused", answer.isError() and answer.exception_code == 2, answer)
        client.close()


def labjack_driver():
    """Our driver for LabJacks, in evfocusd, steers a motor behind a server of `pymodbus`."""
    from pymodbus.server import ModbusTcpServer
    from pymodbus.simulator import DataType, SimData, SimDevice

    state = {"position": 1000.0, "speed": 0.0, "time": time.monotonic()}

    def words(kind, value):
        return list(struct.unpack(">2H", struct.pack(kind, value)))

    def volts(registers):
        return struct.unpack(">f", struct.pack(">2H", *registers))[0]

    async def act(function, start, address, count, registers, values):
        now = time.monotonic()
        state["position"] += state["speed"] * (now - state["time"])
        state["time"] = now
        if values is not None and address == 1000:
            drive, direction = volts(values[0:2]) / 5, volts(values[2:4])
            speed = max(0.0, (drive - 0.12) / 0.88) * 900
            state["speed"] = speed if direction > 2 else -speed
        if address == 0 and values is None:
            registers[address - start:address - start + 2] = words(">f", state["position"] / 4095 * 5)

    def at(address, registers):
        return SimData(address, values=registers, datatype=DataType.REGISTERS)

    device = SimDevice(
        id=0,
        simdata=[
            at(0, words(">f", 0.0)),
            at(1000, [0, 0, 0, 0]),
            at(55100, words(">I", 0x00112233)),
            at(60000, words(">f", 4.0)),
            at(60028, words(">I", 440012345)),
        ],
        action=act,
    )
    ready = threading.Event()
    where = {}

    async def serve():
        server = ModbusTcpServer(device, address=("127.0.0.1", 0))
        await server.serve_forever(background=True)
        where["port"] = server.transport.sockets[0].getsockname()[1]
        ready.set()
        await asyncio.Event().wait()

    threading.Thread(target=lambda: asyncio.run(serve()), daemon=True).start()
    check("the server of pymodbus starts", ready.wait(10))
    section = f"""
        [lens]
        backend = "labjack"
        address = "127.0.0.1:{where['port']}"
        min_counts = 260
        max_counts = 3710
        poll_ms = 5
        [lens.drive]
        tolerance_counts = 10
    """
    with Daemon(section) as daemon:
        devices = daemon.call("devices")
        check("evfocusd finds the device and its serial number", "440012345" in devices, devices.split("lens", 1)[-1].strip())
        for target in (2000, 1200):
            daemon.call("move", str(target), "--wait")
            check("it steers the motor to its target", abs(state["position"] - target) < 30, round(state["position"]))
        daemon.call("move", "3700")
        until("it moves", lambda: state["speed"] > 100)
    check("the motor stands when evfocusd has ended", state["speed"] == 0)


def indi():
    """Our INDI client, in evfocusd, drives INDI's own simulation of a focuser."""
    if not installed("indi_lynx_focus"):
        return
    with IndiDriver("indi_lynx_focus") as driver:
        bridge = Bridge(driver)
        section = f"""
            [lens]
            backend = "indi"
            address = "{bridge.address}"
            poll_ms = 5
            [lens.indi]
            device = "FocusLynx F1"
            max_speed_counts_per_s = 5000
            set_speed = false
            [[lens.indi.settings]]
            property = "SIMULATION"
            member = "ENABLE"
            value = "On"
            [[lens.indi.settings]]
            property = "DEVICE_AUTO_SEARCH"
            member = "INDI_DISABLED"
            value = "On"
            [[lens.indi.settings]]
            property = "POLLING_PERIOD"
            member = "PERIOD_MS"
            value = "20"
        """
        with Daemon(section) as daemon:
            status = daemon.status()
            check("evfocusd connects to indi_lynx_focus and learns its limits", status["lens_range"]["max"] == 65535, status["lens_range"])
            daemon.call("move", "20000", "--wait")
            check("it goes where it is sent", abs(daemon.status()["lens_position"] - 20000) < 2, daemon.status()["lens_position"])
            daemon.call("move", "60000")
            until("it moves", lambda: daemon.status()["lens_position"] > 24000)
            daemon.call("abort")
            time.sleep(0.5)
            stopped = daemon.status()["lens_position"]
            time.sleep(0.5)
            check("it is stopped on the way", daemon.status()["lens_position"] == stopped < 59000, stopped)
            answer = daemon.call("move", "99999", good=False)
            check("a target out of its range is refused", "65535" in answer, answer.strip())


CHECKS = {
    "moonlite": moonlite,
    "optotune": optotune,
    "grbl": grbl,
    "firmata": firmata,
    "labjack-model": labjack_model,
    "labjack-driver": labjack_driver,
    "indi": indi,
}

for name in sys.argv[1:] or CHECKS:
    print(f"-- {name}: {CHECKS[name].__doc__}", flush=True)
    CHECKS[name]()
