"""The process that holds the FMU: reads a request on standard input, and leaves rows and an answer in the room."""

import faulthandler
import json
import os
import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from time import perf_counter

import fmpy
from fmpy.fmi1 import FMICallException

from ...errors import HarnessError, reason
from .agreement import agreed
from .cosimulation import cosimulate
from .exchange import exchange
from .instance import MESSAGES, STATUS, begin, forget, instantiated, words
from .passes import Ended, Pass, Refused, Span
from .request import ANSWER, HUNG, ROWS, SAID, SHARE, TEXTS, Answer, Request
from .rows import Recorder, Texts, read

OFTEN = 0.2  # s between two signs of life
LARGEST = 1_000_000  # bytes of what the FMU prints that are kept
LEFT = 0.8  # of the bar that shows the progress, after each pass


class Life:
    """Tells from time to time that this process is alive; while it does not, a watchdog runs."""

    def __init__(self, room: Path, patience: float) -> None:
        self.hung, self.share = (room / HUNG).open("w"), (room / SHARE).open("w")
        self.patience, self.next, self.done, self.passes = patience, 0.0, 0.0, 0
        self.parent = os.getppid()

    def heed(self, share: float | None = None) -> None:
        """So far is the pass, as a share of it; how many there will be nobody knows."""
        now = perf_counter()
        if now < self.next:
            return
        self.next = now + OFTEN
        if os.getppid() != self.parent:  # it was killed, and nobody waits
            os._exit(1)
        faulthandler.dump_traceback_later(self.patience, exit=True, file=self.hung)
        self.done = self.done if share is None else share
        self.share.seek(0)
        self.share.write(f"{1 - LEFT ** (self.passes + self.done):.6f}")
        self.share.flush()
        forget()
        if os.fstat(1).st_size > LARGEST:
            os.ftruncate(1, 0)


class Host:
    """Runs the FMU pass by pass, each on an instance of its own."""

    def __init__(self, asked: Request, room: Path, life: Life) -> None:
        self.asked, self.room, self.life = asked, room, life
        self.found = fmpy.read_model_description(asked.folder, validate=False)
        variables = {variable.name: variable for variable in self.found.modelVariables}
        self.chosen = [(variables[name], tuple(shape)) for name, shape in asked.outputs.items()]
        self.texts = Texts(room / TEXTS)

    def run(self, h: float, tolerance: float) -> Pass:
        """One pass with a communication step in s and a tolerance."""
        number = self.life.passes
        path = self.room / f"{ROWS}{number}"
        del MESSAGES[:]
        self.life.next = 0.0
        self.life.heed(0.0)
        why: Exception | None = None
        try:
            self.step(path, h, tolerance)
        except FMICallException as error:
            status = dict(enumerate(STATUS)).get(error.status, error.status)
            why = HarnessError(f"{error.function} answered {status}")
        except Exception as error:  # fmpy raises bare Exceptions
            why = error
        sentence = reason(why) if why else ""
        path.touch()
        rows = read(path, self.chosen)
        for older in self.room.glob(f"{ROWS}*") if not sentence else ():
            if older != path:
                older.unlink()  # nobody needs it beside one that is whole
        if sentence:
            at = f" at t = {rows.time[-1]:.9g} s" if len(rows.time) and " at t = " not in sentence else ""
            sentence = ": ".join(filter(None, (sentence + at, words())))
        self.life.passes += 1
        return Pass(number, rows, sentence, isinstance(why, Ended), isinstance(why, Refused))

    def step(self, path: Path, h: float, tolerance: float) -> None:
        """The same; whatever ends it is raised."""
        asked, found = self.asked, self.found
        fmu = instantiated(found, asked.folder, asked.exchange)
        begin(fmu, found, asked.values, asked.start, asked.stop, tolerance)
        sample = Recorder(fmu, found.fmiVersion, self.chosen, path, self.texts).sample
        span, heed = Span(asked.start, asked.stop, h), self.life.heed
        try:
            if asked.exchange:
                exchange(fmu, found, span, tolerance, sample, heed)
            else:
                cosimulate(fmu, found.fmiVersion, span, sample, heed)
        except (Ended, Refused):  # what has failed may crash in whatever is called next: the process's end frees it
            fmu.freeInstance()
            raise
        with suppress(FMICallException):  # all that was wanted is there
            fmu.terminate()
        fmu.freeInstance()


def main() -> None:
    """Answer one request."""
    asked = Request(**json.load(sys.stdin))
    room = Path(asked.room)
    said = os.open(room / SAID, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for stream in (1, 2):  # whatever the FMU prints
        os.dup2(said, stream)
    life = Life(room, asked.patience)
    life.heed(0.0)
    try:
        host = Host(asked, room, life)
        answer = agreed(asked, host.found, host.run)
    except Exception as error:
        answer = Answer(None, "", reason(error))
    written = room / f"{ANSWER}.new"
    written.write_text(json.dumps(asdict(answer)), encoding="utf-8")
    written.rename(room / ANSWER)
    os._exit(0)  # an FMU that has failed may crash when its library is unloaded


if __name__ == "__main__":
    main()
