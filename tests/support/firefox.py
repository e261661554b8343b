"""Control a headless Firefox through Marionette, its protocol for remote control, one page at a time."""

import json
import shutil
import socket
import subprocess
import time
from pathlib import Path
from tempfile import TemporaryDirectory

FIREFOX = next(filter(None, map(shutil.which, ("firefox", "firefox-esr"))), None)
START_SECONDS = 60


class Firefox:
    """The browser process."""

    def __init__(self):
        self.temporary_folder = TemporaryDirectory(ignore_cleanup_errors=True)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        profile = Path(self.temporary_folder.name)
        preferences = {"marionette.port": port, "app.update.enabled": False, "browser.startup.page": 0}
        lines = [f"user_pref({json.dumps(name)}, {json.dumps(value)});\n" for name, value in preferences.items()]
        (profile / "user.js").write_text("".join(lines))
        command = [FIREFOX, "--headless", "--marionette", "--no-remote", "--profile", str(profile)]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.connection = self.connect(port)
        self.stream = self.connection.makefile("rb")
        self.receive()  # the greeting
        self.number = 0
        self.call("WebDriver:NewSession", capabilities={"alwaysMatch": {"timeouts": {"script": 60000}}})

    @staticmethod
    def connect(port):
        deadline = time.monotonic() + START_SECONDS
        while True:
            try:
                return socket.create_connection(("127.0.0.1", port))
            except OSError:
                assert time.monotonic() < deadline, "Firefox does not start"
                time.sleep(0.1)

    def receive(self):
        """Read a message: its length, a colon and JSON."""
        digits = b""
        while not digits.endswith(b":"):
            digits += self.stream.read(1)
        return json.loads(self.stream.read(int(digits[:-1])))

    def call(self, method, **parameters):
        """Send a command and return its result."""
        self.number += 1
        message = json.dumps([0, self.number, method, parameters]).encode()
        self.connection.sendall(b"%d:%s" % (len(message), message))
        _, number, error, result = self.receive()
        assert number == self.number
        assert error is None, error
        return result

    def open(self, address):
        self.call("WebDriver:Navigate", url="about:blank")
        self.call("WebDriver:Navigate", url=address)

    def run(self, script):
        """Evaluate an expression in the page, awaiting a promise."""
        wrapped = f"const done = arguments[0]; Promise.resolve({script}).then(done)"
        return self.call("WebDriver:ExecuteAsyncScript", script=wrapped, args=[], sandbox=None)["value"]

    def run_in_frame(self, script):
        """Evaluate an expression in the only frame of the page."""
        frame = self.call("WebDriver:FindElement", using="css selector", value="iframe")["value"]
        self.call("WebDriver:SwitchToFrame", element=next(iter(frame.values())))
        try:
            return self.run(script)
        finally:
            self.call("WebDriver:SwitchToParentFrame")

    def size(self, width, height=900):
        self.call("WebDriver:SetWindowRect", width=width, height=height)

    def pointer(self, *actions, kind="mouse"):
        """Perform pointer actions: ("down",), ("up",) or ("move", x, y)."""
        steps = [
            {"type": "pointerMove", "x": round(action[1]), "y": round(action[2]), "duration": 0}
            if action[0] == "move"
            else {"type": f"pointer{action[0].title()}", "button": 0}
            for action in actions
        ]
        source = {"type": "pointer", "id": "pointer", "parameters": {"pointerType": kind}, "actions": steps}
        self.call("WebDriver:PerformActions", actions=[source])

    def close(self):
        self.call("Marionette:Quit", flags=["eForceQuit"])
        self.process.wait(30)
        self.stream.close()
        self.connection.close()
        self.temporary_folder.cleanup()
