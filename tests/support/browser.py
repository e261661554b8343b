"""Control a headless Chromium through a pair of pipes (Chrome DevTools Protocol), one page at a time."""

import fcntl
import itertools
import json
import os
import shutil
import subprocess
from base64 import b64decode
from tempfile import TemporaryDirectory

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-dev-shm-usage"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--hide-scrollbars"),
)
READS, WRITES = 3, 4  # file descriptors that Chromium uses for its pipes


class Browser:
    """The browser process. `console` collects console messages, `requested_urls` the addresses that the page loads."""

    def __init__(self):
        self.temporary_folder = TemporaryDirectory(
            ignore_cleanup_errors=True
        )  # a child of Chromium may still be writing
        own_ends, browser_ends = zip(*(self.pipe(i) for i in (1, 0)), strict=True)

        def connect_pipes():
            os.dup2(browser_ends[0], READS)
            os.dup2(browser_ends[1], WRITES)

        arguments = (f"--user-data-dir={self.temporary_folder.name}/profile", "--remote-debugging-pipe", "about:blank")
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self.process = subprocess.Popen(
            [CHROMIUM, *FLAGS, *arguments], pass_fds=(READS, WRITES), preexec_fn=connect_pipes, **quiet
        )
        for end in browser_ends:
            os.close(end)
        self.out, self.into = os.fdopen(own_ends[0], "wb", 0), os.fdopen(own_ends[1], "rb")
        self.numbers, self.buffer = itertools.count(1), b""
        self.console, self.requested_urls, self.session = [], [], None
        targets = self.call("Target.getTargets")["targetInfos"]
        target = next(info["targetId"] for info in targets if info["type"] == "page")
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.is_loaded = False

    @staticmethod
    def pipe(own_end):
        """Create a pipe on high file descriptors and return our end and the browser's; `own_end` is 1 to write, 0 to
        read."""
        ends = os.pipe()
        high = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 20) for end in ends]
        for end in ends:
            os.close(end)
        return high[own_end], high[1 - own_end]

    def call(self, method, **parameters):
        """Send a command and return its result; record the events that arrive before it."""
        number = next(self.numbers)
        message = {"id": number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        self.out.write(json.dumps(message).encode() + b"\0")
        while True:
            message_received = self.receive()
            if message_received.get("id") == number:
                assert "error" not in message_received, (method, message_received)
                return message_received["result"]

    def receive(self):
        while b"\0" not in self.buffer:
            piece = self.into.read1(1 << 16)
            assert piece, "the browser is gone"
            self.buffer += piece
        text, self.buffer = self.buffer.split(b"\0", 1)
        message = json.loads(text)
        parameters = message.get("params", {})
        match message.get("method"):
            case "Runtime.consoleAPICalled":
                self.console.append(str([item.get("value") for item in parameters["args"]]))
            case "Runtime.exceptionThrown":
                self.console.append(parameters["exceptionDetails"].get("exception", {}).get("description", "?"))
            case "Log.entryAdded":
                self.console.append(parameters["entry"]["text"])
            case "Network.requestWillBeSent":
                self.requested_urls.append(parameters["request"]["url"])
            case "Page.loadEventFired":
                self.is_loaded = True
        return message

    def open(self, address):
        """Load an address and wait for the load event. Load an empty page first, so that the same address is loaded
        again."""
        for item in ("about:blank", address):
            self.is_loaded, self.console, self.requested_urls = False, [], []
            self.call("Page.navigate", url=item)
            while not self.is_loaded:
                self.receive()

    def run(self, script):
        """Evaluate an expression in the page, awaiting a promise."""
        options = {"awaitPromise": True, "returnByValue": True, "userGesture": True}
        result = self.call("Runtime.evaluate", expression=script, **options)
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def run_in_frame(self, script):
        """Evaluate an expression in the only frame of the page, which is sandboxed and so a target of its own."""
        page, self.session = self.session, None
        try:
            targets = self.call("Target.getTargets")["targetInfos"]
            (frame,) = (target["targetId"] for target in targets if target["type"] == "iframe")
            self.session = self.call("Target.attachToTarget", targetId=frame, flatten=True)["sessionId"]
            return self.run(script)
        finally:
            self.session = page

    def size(self, width, height=900, touch=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=touch)

    def dark(self, dark=True):
        features = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=features)

    def picture(self, full_page=False):
        """Take a screenshot, as PNG."""
        return b64decode(self.call("Page.captureScreenshot", captureBeyondViewport=full_page)["data"])

    def pdf(self):
        return b64decode(self.call("Page.printToPDF", printBackground=True, preferCSSPageSize=True)["data"])

    def mouse(self, kind, x, y, buttons=1):
        button = {"button": "left", "buttons": buttons, "clickCount": 1}
        self.call("Input.dispatchMouseEvent", type=f"mouse{kind}", x=x, y=y, **button)

    def close(self):
        self.session = None
        self.call("Browser.close")
        self.process.wait(30)
        self.out.close()
        self.into.close()
        self.temporary_folder.cleanup()
