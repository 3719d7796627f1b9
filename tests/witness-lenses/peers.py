"""Starting and stopping the programs of a check, and judging what they say."""

import json
import os
import pathlib
import queue
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time

BIN = pathlib.Path(os.environ["EVFOCUS_BIN"])
PATIENCE = 60


def check(what, holds, detail=""):
    print(f"{'ok  ' if holds else 'FAIL'} {what}{': ' + str(detail) if detail != '' else ''}", flush=True)
    if not holds:
        sys.exit(1)


def wait(condition, patience):
    """Waits for `condition` to give something, and gives it; nothing if it does not in time."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if (value := condition()) not in (None, False):
            return value
        time.sleep(0.02)
    return None


def until(what, condition, patience=PATIENCE):
    """Waits for `condition` to give something, and gives it; else the check has failed."""
    if (value := wait(condition, patience)) is None:
        check(what, False, f"not within {patience} s")
    return value


class Emulator:
    """One of our emulated controllers, on a pseudo-terminal or a socket."""

    def __init__(self, protocol):
        command = [BIN / "examples" / "wire", protocol]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.address = self.process.stdout.readline().strip()
        self.glass = None
        threading.Thread(target=self.follow, daemon=True).start()
        until("the emulator starts", lambda: self.glass)

    def follow(self):
        for line in self.process.stdout:
            self.glass = float(line)

    def stands(self, patience=PATIENCE):
        """Where the glass is, once it has stood for a while; nothing if it does not in time."""
        seen = [None, time.monotonic()]

        def has_stood():
            if self.glass != seen[0]:
                seen[:] = [self.glass, time.monotonic()]
            return time.monotonic() - seen[1] > 0.5

        return self.glass if wait(has_stood, patience) else None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.wait(timeout=10)


class IndiDriver:
    """An INDI driver by others, spoken to on its standard input and output as an INDI server would."""

    def __init__(self, program):
        self.home = tempfile.TemporaryDirectory()
        environment = {**os.environ, "HOME": self.home.name}
        self.process = subprocess.Popen(
            [program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )
        self.said = ""
        self.listeners = []
        threading.Thread(target=self.follow, daemon=True).start()

    def follow(self):
        while chunk := os.read(self.process.stdout.fileno(), 65536):
            self.said += chunk.decode(errors="replace")
            for listener in self.listeners:
                listener(chunk)

    def send(self, data):
        self.process.stdin.write(data)
        self.process.stdin.flush()

    def set(self, device, kind, name, member, value):
        self.send(
            f"<new{kind}Vector device='{device}' name='{name}'><one{kind} name='{member}'>{value}</one{kind}>"
            f"</new{kind}Vector>\n".encode()
        )

    def wait(self, what, pattern, patience=PATIENCE):
        """Waits for something that matches, said from now on or since the last wait, and gives the match."""

        def found():
            return re.search(pattern, self.said, re.DOTALL)

        match = until(what, found, patience)
        self.said = self.said[match.end():]
        return match

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        try:
            self.process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.home.cleanup()


class Bridge:
    """Puts an INDI driver on a loopback port for one client: an INDI server listens on every interface."""

    def __init__(self, driver):
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % self.listener.getsockname()[1]
        self.driver = driver
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        client, _ = self.listener.accept()
        chunks = queue.Queue()
        self.driver.listeners.append(chunks.put)
        threading.Thread(target=self.forward, args=(chunks, client), daemon=True).start()
        while data := client.recv(65536):
            self.driver.send(data)

    @staticmethod
    def forward(chunks, client):
        try:
            while True:
                client.sendall(chunks.get())
        except OSError:
            pass


class Daemon:
    """evfocusd with a lens section, and the command line to talk to it."""

    def __init__(self, section):
        self.folder = tempfile.TemporaryDirectory()
        folder = pathlib.Path(self.folder.name)
        self.socket = folder / "socket"
        config = folder / "rig.toml"
        config.write_text(section)
        self.log = (folder / "log").open("w+")
        command = [BIN / "evfocusd", "--config", config, "--socket", self.socket, "--state-dir", folder / "state"]
        self.process = subprocess.Popen(command, stderr=self.log)
        until("evfocusd starts", self.is_ready)
        self.call("mode", "manual")

    def is_ready(self):
        if self.process.poll() is not None:
            self.log.seek(0)
            check("evfocusd starts", False, self.log.read())
        return self.socket.exists() and "lens_position" in (self.status() or {})

    def call(self, *arguments, good=True):
        command = [BIN / "evfocus", *arguments, "--socket", self.socket]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
        if good and done.returncode != 0:
            self.log.seek(0)
            check(" ".join(map(str, arguments)), False, done.stderr + self.log.read())
        return done.stdout + done.stderr

    def status(self):
        done = subprocess.run([BIN / "evfocus", "status", "--json", "--socket", self.socket], capture_output=True, text=True)
        return json.loads(done.stdout) if done.returncode == 0 else None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(timeout=20)
        self.log.close()
        self.folder.cleanup()


def installed(program):
    """Whether a program by others is there; a line says so if it is not."""
    if shutil.which(program):
        return True
    print(f"left out: {program} is not installed (Debian: indi-bin)")
    return False
