"""Talks to evfocusd through the Varlink client of the Python package index, which shares no code with evfocus."""

import re
import subprocess
import sys

import varlink

INTERFACE = "org.evfocus.Controller"
METHODS = [
    "GetStatus",
    "Focus",
    "Abort",
    "MoveTo",
    "Calibrate",
    "SetMode",
    "Pause",
    "Resume",
    "Monitor",
    "GetReport",
    "ListDevices",
    "Reload",
]


def check(what, holds, detail=""):
    print(f"{'ok  ' if holds else 'FAIL'} {what}{': ' + str(detail) if detail else ''}", flush=True)
    if not holds:
        sys.exit(1)


def refused(call, name):
    """The parameters of the error `name` that `call` must be refused with."""
    try:
        call()
    except varlink.VarlinkError as error:
        check(f"refused with {name}", error.error() == name, error.parameters())
        return error.parameters()
    check(f"refused with {name}", False, "not refused")


def command_line(*arguments):
    command = [sys.executable, "-m", "varlink.cli", *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=30).stdout


def introspection(address, client):
    info = command_line("info", address)
    check("`varlink info` names product and interfaces", "evfocusd" in info and INTERFACE in info)
    text = command_line("help", f"{address}/{INTERFACE}")
    methods = re.findall(r"^method (\w+)", text, re.MULTILINE)
    check("`varlink help` shows every method", methods == METHODS, ", ".join(methods))

    interface = client.get_interface(INTERFACE)
    defined = {name for name, _ in interface.members.items()}
    used = set(re.findall(r"[:\]?]\s*([A-Z]\w*)", re.sub(r"#.*", "", interface.description)))
    check("every type that is used is described", used <= defined, f"{len(used)} types")
    check("the errors are described", {"Busy", "OutOfRange", "InvalidArgument"} <= defined)


def calls(connection):
    status = connection.GetStatus()["status"]
    check("GetStatus", status["state"] in ("idle", "focused", "failed") and status["mode"] == "auto", status["state"])
    devices = connection.ListDevices()["devices"]
    check("ListDevices", {device["role"] for device in devices} == {"camera", "lens"}, len(devices))
    check("Abort without a run", connection.Abort().get("run_id") is None)
    connection.SetMode(mode="auto")
    check("SetMode", True)
    refused(lambda: connection.Pause(when="deferred"), f"{INTERFACE}.WrongMode")
    refused(connection.Resume, f"{INTERFACE}.WrongMode")


def refusals(connection, limits):
    parameters = refused(lambda: connection.MoveTo(position=1e9), f"{INTERFACE}.OutOfRange")
    check("the error tells the range", parameters["min"] == limits["min"] and parameters["max"] == limits["max"])
    parameters = refused(lambda: connection.SetMode(mode="turbo"), f"{INTERFACE}.InvalidArgument")
    check("the error names the argument", parameters["name"] == "mode")
    parameters = refused(lambda: list(connection.Focus(method="esg", _more=True)), f"{INTERFACE}.UnknownMethod")
    check("the error tells the known methods", "egs" in parameters["known"])
    refused(lambda: connection.GetReport(id=999_999_999), f"{INTERFACE}.NoSuchReport")
    refused(lambda: connection.Monitor(), "org.varlink.service.ExpectedMore")


def focusing(client, connection):
    with client.open(INTERFACE) as other:
        news = connection.Focus(_more=True)
        first = next(news)["progress"]
        run = first["run_id"]
        check("Focus streams", not first["done"], f"run {run}")
        status = other.GetStatus()["status"]
        check("others are served meanwhile", status["state"] == "scanning" and status["run_id"] == run)
        refused(lambda: other.MoveTo(position=status["lens_range"]["min"]), f"{INTERFACE}.Busy")
        follower = other.Focus(_more=True)
        check("Focus during a run follows it", next(follower)["progress"]["run_id"] == run)
        followed = [message["progress"] for message in follower][-1]
    messages = [first] + [message["progress"] for message in news]
    last = messages[-1]
    report = last["report"]
    points = sum(1 for message in messages if message.get("curve_point"))
    check("the stream ends with the report", last["done"] and report["run_id"] == run, f"{len(messages)} messages, {points} points")
    check("both followers have the same report", followed["report"] == report)
    check("the curve came live", points > 10)
    result = report["result"]
    check("the run has an outcome", result["state"] in ("focused", "failed"), result["message"])
    check("GetReport has it too", connection.GetReport()["report"] == report and connection.GetReport(id=run)["report"] == report)

    waited = connection.Focus()["progress"]
    check("without `more`, Focus replies once, when the run is over", waited["done"] and waited["run_id"] == run + 1)


def monitoring(connection):
    changes = connection.Monitor(_more=True)
    statuses = [next(changes)["status"] for _ in range(3)]
    check("Monitor streams", all("event_rate" in status for status in statuses))


def main(path):
    address = f"unix:{path}"
    with varlink.Client.new_with_address(address) as client:
        introspection(address, client)
        with client.open(INTERFACE) as connection:
            calls(connection)
            refusals(connection, connection.GetStatus()["status"]["lens_range"])
            focusing(client, connection)
            monitoring(connection)


main(sys.argv[1])
