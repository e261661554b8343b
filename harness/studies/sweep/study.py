"""What happens over many parameters: one FMU, many points, workers by Dask, and a journal that survives a kill.

A worker keeps one instance and runs it again and again.  Every block of runs that is finished is written to the
journal beside the results, so the same command after an interruption does only what is left.  The rows do not depend
on who ran them, nor in which order.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from threading import Lock
from time import perf_counter
from typing import Any

import numpy as np

from ...errors import HarnessError, reason
from ...process.interrupt import HEARD, Interrupted, deaf_children
from ...process.room import room
from .rerun import Measured, Rerun, Runs, ready
from .space import Axis

LONGEST_BLOCK = 200  # runs
BLOCKS = 20  # for each worker at least, so that progress shows and no worker waits for the last one
BUSY = Lock()  # an FMU of pythonfmu is one thread's at a time
LOADED: dict[tuple[str, bytes], Rerun] = {}  # in a worker: its instances
HELD = ExitStack()  # what frees them
# without an address Dask's scheduler would serve its health at port 8787, and warn where that is taken
UNSEEN = {"dashboard_address": "127.0.0.1:0", "scheduler_kwargs": {"dashboard": False}}
EXTRA = "python -m pip install 'friction-fmus[sweep]'"


@dataclass(frozen=True)
class Sweep:
    """The `runs` at `points` (n, len(varied)): a grid over `axes`, or a sample of `random` points with its `seed`.  A
    row has so many `columns`."""

    runs: Runs
    axes: tuple[Axis, ...]
    points: np.ndarray
    random: int | None
    seed: int
    fmu: bytes
    columns: int

    @property
    def digest(self) -> str:
        """SHA-256 of the FMU, in hexadecimal."""
        return sha256(self.fmu).hexdigest()

    @property
    def key(self) -> str:
        """What tells this sweep from any other."""
        whole = [asdict(self.runs), [asdict(axis) for axis in self.axes], self.random, self.seed, self.digest]
        return sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()[:16]


def perform(
    sweep: Sweep, folder: Path, scheduler: str | None, workers: int, report: Callable[[float], None]
) -> tuple[list[Measured], int, int, float]:
    """The rows of all points, in their order; how many of them an earlier, interrupted sweep had finished; how many
    lines of its journal were damaged; and the seconds that the others took, once the workers were there.

    `folder` receives the journal; it is removed by `forget` once the results are written.
    """
    kept = Journal(folder / f".{sweep.key}.jsonl", len(sweep.points), sweep.columns)
    before, seconds = len(kept.rows), 0.0
    left = [i for i in range(len(sweep.points)) if i not in kept.rows]
    if left:
        try:
            with client(scheduler, workers) as dask, kept.open():
                begun = perf_counter()
                for block in finished(dask, sweep, left):
                    kept.add(block)
                    report(len(kept.rows) / len(sweep.points))
                    seconds = perf_counter() - begun
        except BaseException as error:  # what an interrupt makes fail may say anything
            if not (HEARD or isinstance(error, KeyboardInterrupt)):
                raise
            if not kept.rows:
                forget(sweep, folder)
            state = f"{len(kept.rows)} of {len(sweep.points)} runs are kept"
            raise Interrupted(f"interrupted: {state}; the same command does the rest") from None
    return [kept.rows[i] for i in range(len(sweep.points))], before, kept.damaged, seconds


def finished(dask: Any, sweep: Sweep, left: list[int]) -> Iterator[list[tuple[int, Measured]]]:
    """The blocks of runs as workers finish them."""
    from distributed import as_completed

    hands = max(1, sum(dask.nthreads().values()))
    size = max(1, min(LONGEST_BLOCK, len(left) // (BLOCKS * hands)))
    blocks = [[(i, sweep.points[i].tolist()) for i in left[at : at + size]] for at in range(0, len(left), size)]
    fmu = dask.scatter(sweep.fmu, broadcast=True)
    futures = dask.map(work, blocks, runs=sweep.runs, fmu=fmu, pure=False)
    try:
        for future in as_completed(futures):
            try:
                block = future.result()
            except HarnessError:
                raise
            except Exception as error:  # whatever kept a worker from working: no harness there, no memory, killed
                raise HarnessError(f"a worker failed: {type(error).__name__}: {error}") from None
            yield block
    finally:
        dask.cancel(futures)
        dask.run(unload)


def work(block: list[tuple[int, list[float]]], runs: Runs, fmu: bytes) -> list[tuple[int, Measured]]:
    """Run a block in a worker, with the instance that it keeps."""
    with BUSY:
        key = (json.dumps(asdict(runs), sort_keys=True), sha256(fmu).digest())
        if key not in LOADED:
            file = HELD.enter_context(room("sweep-")) / f"{runs.model}.fmu"
            file.write_bytes(fmu)
            LOADED[key] = HELD.enter_context(ready(runs, file))
        return [(i, LOADED[key].run(point)) for i, point in block]


def unload() -> None:
    """Let a worker free its instances and remove their files."""
    with BUSY:
        LOADED.clear()
        HELD.close()


@contextmanager
def client(scheduler: str | None, workers: int) -> Iterator[Any]:
    """A client of the scheduler at an address, or of a local cluster with so many processes."""
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise HarnessError(f"a sweep needs Dask: {EXTRA}") from None
    dask.config.set({"logging.distributed": "error"})
    if scheduler is None:
        with ExitStack() as held:
            folder = str(held.enter_context(room("dask-")))
            held.enter_context(dask.config.set({"temporary-directory": folder}))
            with deaf_children():
                cluster = held.enter_context(
                    LocalCluster(
                        n_workers=workers,
                        threads_per_worker=1,
                        silence_logs=50,
                        env={"TMPDIR": folder},
                        **UNSEEN,
                    )
                )
                local = held.enter_context(Client(cluster))
            yield local
        return
    try:
        remote = Client(scheduler, timeout=10)
    except (OSError, ValueError) as error:
        raise HarnessError(f"no scheduler answers at {scheduler}: {reason(error)}") from None
    with remote:
        if not remote.nthreads():
            raise HarnessError(f"the scheduler at {scheduler} has no workers; start one: dask worker {scheduler}")
        yield remote


class Journal:
    """The finished runs of one sweep, a line for each, in a file; what is no such line is left out.

    `damaged` counts those, but for the last: a kill cut it off.
    """

    def __init__(self, path: Path, points: int, columns: int) -> None:
        self.path = path
        with self.told():
            lines = path.read_bytes().splitlines(keepends=True) if path.exists() else []
        found = [kept(line, points, columns) for line in lines]
        self.rows: dict[int, Measured] = dict(filter(None, found))
        self.damaged = found[:-1].count(None) + (bool(found) and not found[-1] and lines[-1].endswith(b"\n"))

    @contextmanager
    def told(self) -> Iterator[None]:
        """What the file system refuses becomes one sentence."""
        try:
            yield
        except OSError as error:
            raise HarnessError(f"the journal {self.path} cannot be used: {error.strerror}") from None

    @contextmanager
    def open(self) -> Iterator[None]:
        """Keep the file open for writing, without what was cut off."""
        fresh = self.path.with_suffix(".new")
        with self.told():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.file = fresh.open("w", encoding="utf-8")
        try:
            self.write(self.rows.items())
            with self.told():
                fresh.replace(self.path)
            yield
        finally:
            with suppress(OSError):  # of a full disk, which was told
                self.file.close()
            fresh.unlink(missing_ok=True)

    def add(self, block: list[tuple[int, Measured]]) -> None:
        self.rows.update(block)
        self.write(block)

    def write(self, rows: Iterable[tuple[int, Measured]]) -> None:
        with self.told():
            self.file.writelines(json.dumps([i, *row]) + "\n" for i, row in rows)
            self.file.flush()


def kept(line: bytes, points: int, columns: int) -> tuple[int, Measured] | None:
    """The number of a run and its row, None if a line holds none."""
    try:
        i, values, error = json.loads(line)
        numbers = isinstance(values, list) and all(isinstance(value, float) for value in values)
        whole = numbers and isinstance(error, str) and len(values) == (0 if error else columns)
        return (i, (values, error)) if whole and type(i) is int and 0 <= i < points else None
    except (ValueError, TypeError, RecursionError):
        return None


def forget(sweep: Sweep, folder: Path) -> None:
    """Remove the journal."""
    (folder / f".{sweep.key}.jsonl").unlink(missing_ok=True)
