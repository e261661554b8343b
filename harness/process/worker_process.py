"""The process of a `Worker`: it calls functions one after the other, and sends back what they return.

Requests and replies are pickled and preceded by their length. Other output, such as that of FMUs, goes to standard
error, and standard input is empty for other readers. The process ends with its parent, even while a function runs.
"""

import os
import pickle
import signal
import sys
from collections.abc import Iterator
from contextlib import suppress
from queue import SimpleQueue
from shutil import rmtree
from struct import Struct
from threading import Thread
from time import monotonic
from traceback import print_exc
from typing import IO, Any

from ..errors import HarnessError

END = b""  # the last request
READY, PROGRESS, RESULT = "ready", "progress", "result"  # kinds of replies
ERROR, FAILURE = "error", "failure"  # a HarnessError, and the text of another exception
REPORT_INTERVAL = 0.2  # s between progress reports
MAX_OUTPUT_BYTES = 1_000_000  # captured output of a process; checked when it reports progress
LENGTH = Struct("<Q")  # of a message in bytes


def write_message(stream: IO[bytes], message: bytes) -> None:
    """Write a message and its length."""
    stream.write(LENGTH.pack(len(message)) + message)
    stream.flush()


def read_messages(stream: IO[bytes]) -> Iterator[bytes]:
    """Yield all messages of a stream; an incomplete last one is dropped."""
    while len(head := read_bytes(stream, LENGTH.size)) == LENGTH.size:
        (length,) = LENGTH.unpack(head)
        if len(message := read_bytes(stream, length)) == length:
            yield message


def read_bytes(stream: IO[bytes], size: int) -> bytes:
    """Read `size` bytes, or less at the end of the stream."""
    content = bytearray()
    while len(content) < size and (part := stream.read(size - len(content))):
        content += part
    return bytes(content)


class RequestServer:
    """Answers the requests of the parent.

    Parameters
    ----------
    folder : str
        Folder of temporary files, which is removed if the parent is killed.
    """

    def __init__(self, folder: str) -> None:
        self.folder, self.next_report = folder, 0.0
        # without a buffer, whose lock the thread would hold while Python ends
        self.request_stream = os.fdopen(os.dup(0), "rb", buffering=0)
        self.reply_stream = os.fdopen(os.dup(1), "wb")
        null_device = os.open(os.devnull, os.O_RDONLY)
        os.dup2(null_device, 0)
        os.dup2(2, 1)
        self.requests: SimpleQueue[bytes] = SimpleQueue()
        Thread(target=self.read_requests, daemon=True).start()

    def read_requests(self) -> None:
        """Queue all requests up to END. Exit if the stream ends before it: the parent was killed."""
        for request in read_messages(self.request_stream):
            self.requests.put(request)
            if request == END:
                return
        rmtree(self.folder, ignore_errors=True)
        os._exit(1)  # sys.exit would end this thread only, and the main thread may be in a call of an FMU

    def serve(self) -> None:
        """Answer requests until END."""
        self.send(READY, None)
        while (request := self.requests.get()) != END:
            try:
                function, arguments, wants_report = pickle.loads(request)
                options = {"report": self.report} if wants_report else {}
                reply = RESULT, function(*arguments, **options)
            except HarnessError as error:
                reply = ERROR, portable_error(error)
            except Exception as error:
                print_exc()
                reply = FAILURE, f"{type(error).__name__}: {error}"
            self.send(*reply)

    def report(self, progress: float, note: str = "") -> None:
        """Report a progress from 0 to 1 with a note, which renews the time limit of the call."""
        now = monotonic()
        if now < self.next_report:
            return
        self.next_report = now + REPORT_INTERVAL
        self.send(PROGRESS, (progress, note))
        if os.fstat(2).st_size > MAX_OUTPUT_BYTES:
            os.ftruncate(2, 0)

    def send(self, kind: str, content: Any) -> None:
        """Send a reply to the parent. If it was killed, read_requests removes the files and ends this process."""
        with suppress(BrokenPipeError):
            write_message(self.reply_stream, pickle.dumps((kind, content), pickle.HIGHEST_PROTOCOL))


def portable_error(error: HarnessError) -> HarnessError:
    """Return an error that the parent can unpickle, of the same class where possible."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # its constructor takes other arguments
        return HarnessError(str(error))
    return error


def limit_memory(size: int) -> None:
    """Limit the memory of this process to a size in bytes, where the system can."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (size, size))


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C and kills this process
    temporary_folder, memory = sys.argv[1:]
    if int(memory):
        limit_memory(int(memory))
    RequestServer(temporary_folder).serve()
