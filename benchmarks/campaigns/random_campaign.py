"""Run random models with dry friction and compare them with independent_contacts.py.

    python -m benchmarks.campaigns.random_campaign --structures 20 --values 25

prints a table of failures with the seeds that reproduce them, and

    python -m benchmarks.campaigns.random_campaign --show 12 3 --method 4 --rtol 1e-6

lists the events of one run beside those of the reference.

What is compared
----------------
At points halfway between the events of the reference, and on a grid: modes, number of events, time of the last event,
and states.  The states may differ by 100 rtol of their size, amplified as the motion amplifies small changes: the
reference is solved again with all values changed by up to 100 rtol, and six times the difference that this makes is
allowed as well.  The time of an event may also differ by the time in which its guard falls by 100 rtol of its size:
where a slip grazes zero, this is long.  A near-tie ends the comparison: a decision with a margin below 1000 rtol, or
one that the changed values decide differently.  Python, native and FMI 3.0 FMUs must agree bit for bit.
"""

import argparse
import hashlib
import itertools
import pickle
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from math import inf, isnan
from pathlib import Path

import build_cache
import numpy as np
from worker_client import FmiError, Worker

from benchmarks.campaigns import independent_contacts, random_models
from benchmarks.campaigns.independent_contacts import solve
from benchmarks.campaigns.random_models import STOP, perturb, random_structure, random_values, to_system, write_model

ROOT = Path(__file__).resolve().parents[2]
METHODS = {2: "ode23", 3: "ode45", 4: "dop853", 5: "rodas", 6: "radau9"}
EVERY_METHOD = tuple(f"--method={label}" for label in METHODS.values())  # radau9 is offered only on request
TOLERANCES = (1e-6, 1e-11)
STATE_TOLERANCE = 100.0  # times rtol: allowed error of states and changes of values of the reference
MARGIN = 1000.0  # times rtol: decisions with smaller margins are not compared
MANY_STEPS = 20000  # more steps may add up to proportionally larger errors
KINK = 100.0  # factor after a limited load has begun or ended: a choose() is not an event, its kink costs accuracy
AMPLIFICATION = 6.0  # times the difference between the references: allowed error
PERTURBED_RUNS = {1e-6: 2, 1e-11: 1}
MIN_SIZE = 1e-3  # m and m/s: floor of the size of states, as in the error norm of the solver
TIME_SCALE = 0.1  # s: 100 rtol of it are allowed for the times of events, more where their guards fall slowly
SAME_TIME = 1e-8  # s: events of runs with ties that are closer together count as one
BACKENDS = {
    "python": (),
    "native": ("--native", "--platform", "linux64"),
    "fmi3": ("--fmi", "3", "--platform", "linux64"),
}


@dataclass
class ExpectedRun:
    """What a run with one tolerance must show; rows are (t, modes, least and most events, time of the last event,
    its tolerance, states, their tolerances)."""

    until: float = STOP
    reason: str = ""
    rows: list = field(default_factory=list)


@dataclass
class Reference:
    """The solution of a case and what runs must show for each tolerance."""

    first_modes: tuple
    events: list
    decisions: list
    failure: str
    times: list
    expected: dict


@dataclass
class Failure:
    """A difference between a run and its reference."""

    structure: int
    values: int
    backend: str
    method: int
    rtol: float
    kind: str
    t: float
    text: str
    context: str = ""

    def __str__(self):
        return (
            f"{self.structure:4} {self.values:4} {self.backend:6} {METHODS.get(self.method, '')!s:6} {self.rtol:5.0e} "
            f"{self.kind:6} {self.t:9.6f} {self.context:28} {self.text}"
        )


# ---- references


def solve_case(structure, seed):
    """Return the solution of a case and those with changed values for each tolerance, at the same times."""
    values, has_ties = random_values(structure, seed)
    system = to_system(structure, values)
    solution = solve(system)
    times = sample_times(solution)
    changed_solutions = {}
    for rtol in TOLERANCES:
        names = [f"{structure.seed} {seed} {n}" for n in range(PERTURBED_RUNS[rtol])]
        changed_solutions[rtol] = [solve(perturb(system, STATE_TOLERANCE * rtol, name, has_ties)) for name in names]
    for sampled_solution in (solution, *(other for others in changed_solutions.values() for other in others)):
        sampled_solution.sample(times)
    return solution, changed_solutions, times, has_ties


def make_reference(structure, seed, solutions=None):
    """Return the reference of a case."""
    solution, changed_solutions, times, has_ties = solutions or solve_case(structure, seed)
    size = state_size(solution, times)
    expected = {
        rtol: make_expected(solution, changed_solutions[rtol], times, size, rtol, has_ties) for rtol in TOLERANCES
    }
    decisions = [(float(d.t), d.kind, d.contact, float(d.margin)) for d in solution.decisions]
    events = [(float(t), modes) for t, modes in solution.events]
    return Reference(solution.first_modes, events, decisions, solution.failure, times, expected)


def sample_times(solution):
    """Return the times at which runs are compared: a grid, and points halfway between events."""
    events = [0.0, *(float(t) for t, _ in solution.events), min(float(solution.end), STOP)]
    times = {0.5 * (a + b) for a, b in itertools.pairwise(events) if b - a > SAME_TIME}
    times |= {STOP * n / 16 for n in range(17)}
    return sorted(t for t in times if t <= solution.end)


def state_size(solution, times):
    states = np.abs([solution.states(t) for t in times])
    n = states.shape[1] // 2
    return np.repeat([max(states[:, :n].max(), MIN_SIZE), max(states[:, n:].max(), MIN_SIZE)], n)


def clusters(events):
    """Merge events that are closer together than SAME_TIME: (t, modes after them)."""
    merged_events = []
    for t, modes in events:
        if merged_events and t - merged_events[-1][0] < SAME_TIME:
            merged_events[-1] = (merged_events[-1][0], modes)
        else:
            merged_events.append((t, modes))
    return merged_events


def make_expected(solution, changed_solutions, times, size, rtol, has_ties):
    """Return what runs with a tolerance must show."""
    group = clusters if has_ties else list
    events = group(solution.events)
    until, decision = solution.decided_until(MARGIN * rtol)
    until, reason = min(until, solution.end), f"{decision.kind} {decision.margin:.0e}" if decision else ""
    errors = [0.0] * len(events)
    for other in changed_solutions:
        others = group(other.events)
        if other.first_modes != solution.first_modes:
            until, reason = 0.0, "changed values"
        for n in range(max(len(events), len(others))):
            pair = [sequence[n] if n < len(sequence) else (inf, None) for sequence in (events, others)]
            if pair[0][1] != pair[1][1]:
                if min(pair)[0] < until:
                    until, reason = min(pair[0][0], pair[1][0]), "changed values"
                break
            errors[n] = max(errors[n], abs(pair[0][0] - pair[1][0]))
        until = min(until, other.end)
    # A guard with the allowed relative error E has its zero within E / steepness.  Changed values do not show this: the
    # exact motion of other values meets a grazing zero with the same geometry.
    scales = [max(TIME_SCALE, 1.0 / max(solution.steepness.get(t, inf), 1e-300)) for t, _ in events]
    time_errors = [AMPLIFICATION * e + STATE_TOLERANCE * rtol * scale for e, scale in zip(errors, scales, strict=True)]
    result = ExpectedRun(float(until), reason)
    for t in times:
        near = [
            abs(t - s) <= 2.0 * e * (KINK if solution.kinks else 1.0)
            for (s, _), e in zip(events, time_errors, strict=True)
        ]
        if any(near) or t > until - 2.0 * STATE_TOLERANCE * rtol * TIME_SCALE:
            continue
        state = solution.states(t)
        kink = KINK if any(s < t for s in solution.kinks) else 1.0
        error = max((np.abs(other.states(t) - state) for other in changed_solutions), key=np.max)
        past_events = [n for n, (s, _) in enumerate(events) if s <= t]
        changes = [solution.first_modes, *(modes for s, modes in solution.events if s <= t)]
        # a contact that reverses with its load at the limit may stick for a moment
        max_count = sum(sum(abs(a - b) for a, b in zip(x, y, strict=True)) for x, y in itertools.pairwise(changes))
        result.rows.append(
            (
                t,
                solution.modes(t),
                len(past_events),
                max_count if has_ties else len(past_events),
                float(events[past_events[-1]][0]) if past_events else 0.0,
                kink * time_errors[past_events[-1]] if past_events else 0.0,
                state,
                kink * (AMPLIFICATION * error + STATE_TOLERANCE * rtol * size),
            )
        )
    return result


def cached_reference(structure, seed, folder):
    """Return the reference of a case; its solutions come from a file if they have been computed before."""
    sources = [Path(module.__file__) for module in (independent_contacts, random_models)]
    text = b"".join(file.read_bytes() for file in sources)
    path = folder / f"solution-{structure.seed}-{seed}-{hashlib.sha256(text).hexdigest()[:8]}.pickle"
    if not path.exists():
        path.write_bytes(pickle.dumps(solve_case(structure, seed)))
    return make_reference(structure, seed, pickle.loads(path.read_bytes()))


# ---- runs


def build(structures, folder, backends=tuple(BACKENDS), root=ROOT):
    """Write and build the models of structures by the sources under `root`; return {(seed, backend): path} and the
    refused ones."""
    folder.mkdir(parents=True, exist_ok=True)
    paths, failures = {}, []
    for structure in structures:
        file = folder / f"{structure.name}.py"
        file.write_text(write_model(structure))
        for backend in backends:
            out = folder / backend
            command = [sys.executable, "build_fmus.py", str(file), *BACKENDS[backend], *EVERY_METHOD, "--out", str(out)]
            process = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=600)
            if process.returncode == 0:
                paths[structure.seed, backend] = out / f"{structure.name}.fmu"
            else:
                failures.append(
                    Failure(structure.seed, -1, backend, 0, 0.0, "build", 0.0, process.stderr.strip()[-200:])
                )
    return paths, failures


def names_of(structure):
    states = [f"x{i}" for i in range(structure.n)] + [f"v{i}" for i in range(structure.n)]
    modes = [f"mode{n}" for n in range(len(structure.contacts))]
    return [*modes, "events.count", "events.t_last", *states, "solver.steps", "solver.evaluations"]


def run(worker, path, structure, values, method, rtol, times):
    """Run an FMU; return the rows up to an error, and its message."""
    names = names_of(structure)
    settings = {**values, "solver.method": method, "solver.rtol": rtol}
    fmu, rows, message = worker.instantiate(path), [], ""
    try:
        fmu.set(settings)
        fmu.setup(0.0, STOP, None)
        fmu.init()
        try:
            rows = fmu.run(times, names)
        except FmiError:
            fmu.messages()
            fmu.free()
            fmu = worker.instantiate(path)
            fmu.begin(settings, stop=STOP)
            rows = [fmu.get(*names)]
            for t, ahead in itertools.pairwise(times):
                fmu.step(t, ahead - t)
                rows.append(fmu.get(*names))
    except FmiError:
        message = next((text for status, _, text in fmu.messages() if status), "no message")
    if worker.alive:
        fmu.free()
    return rows, message


def compare(rows, message, times, expected, structure):
    """Return kind, time and text of the first difference, or None."""
    n = len(structure.contacts)
    by_time = dict(zip(times, rows, strict=False))
    for t, modes, min_count, max_count, last, time_error, state, error in expected.rows:
        if t not in by_time:
            return "error", t, message
        row = by_time[t]
        factor = max(1.0, row[-2] / MANY_STEPS)
        count, t_last, states = row[n], row[n + 1], np.array(row[n + 2 : n + 2 + len(state)])
        if not min_count <= count <= max_count:
            return (
                "count",
                t,
                f"{count} events, expected {min_count}{f' to {max_count}' if max_count > min_count else ''}; "
                f"last {t_last!r}",
            )
        if any(b is not None and a != b for a, b in zip(row, modes, strict=False)):
            return "modes", t, f"modes {tuple(row[:n])}, expected {modes}"
        if min_count and abs(t_last - last) > factor * time_error:
            return "time", t, f"event at {t_last!r}, expected {last!r} +- {time_error:.1e}"
        worst = int(np.argmax(np.abs(states - state) / error))
        if not abs(states[worst] - state[worst]) <= factor * error[worst]:
            return "state", t, f"state {worst} {states[worst]!r}, expected {state[worst]!r} +- {error[worst]:.1e}"
    return None


def describe(reference, structure, values, t):
    """Describe what happens in the reference just before the time of a difference."""
    words = []
    before = [s for s in reference.times if s < t]
    start = before[-2] if len(before) > 1 else 0.0
    if any(kind == "touch" and start <= s <= t for s, kind, *_ in reference.decisions):
        words.append("touch")
    last = reference.first_modes
    for s, modes in reference.events:
        if start <= s <= t:
            contacts = [n for n in range(len(modes)) if modes[n] != last[n]]
            if len(contacts) > 1:
                words.append("several")
            for n in contacts:
                hold = values.get(f"mu{n}_s", values.get(f"mu{n}_p", values[f"mu{n}_d"]))
                words += ["no hold"] * (hold == 0.0)
                words += ["limited"] * structure.contacts[n].is_limited
                words += ["moving belt"] * structure.contacts[n].belt_moves
        last = modes
    margins = [m for s, _, _, m in reference.decisions if start <= s <= t]
    if margins and min(margins) < inf:
        words.append(f"{min(margins):.0e}")
    return ", ".join(dict.fromkeys(words))


def run_case(worker, paths, structure, seed, reference, backends=("native",), slow_backends=()):
    """Run a case with all methods and tolerances; return failures and counts of what was compared."""
    values, _ = random_values(structure, seed)
    failures, counts = [], Counter()
    for rtol, expected in reference.expected.items():
        counts["events", rtol] += len(reference.events)
        counts["compared events", rtol] += sum(t < expected.until for t, _ in reference.events)
        for method in METHODS:
            results = {}
            for backend in (*backends, *(slow_backends if rtol == TOLERANCES[0] else ())):
                if (structure.seed, backend) not in paths:
                    continue
                try:
                    path = paths[structure.seed, backend]
                    results[backend] = run(worker, path, structure, values, method, rtol, reference.times)
                except AssertionError as error:
                    worker = Worker()
                    failures.append(
                        Failure(structure.seed, seed, backend, method, rtol, "died", 0.0, str(error)[-200:])
                    )
            counts["runs"] += len(results)
            first = next(iter(results), None)
            for backend, (rows, message) in results.items():
                if backend == first:
                    difference = compare(rows, message, reference.times, expected, structure)
                    if difference:
                        context = describe(reference, structure, values, difference[1])
                        failures.append(
                            Failure(structure.seed, seed, backend, method, rtol, *difference, context=context)
                        )
                    elif message:
                        counts["errors after a near-tie"] += 1
                elif repr(rows) != repr(results[first][0]) or message != results[first][1]:
                    failures.append(
                        Failure(structure.seed, seed, backend, method, rtol, "bits", 0.0, f"differs from {first}")
                    )
    return failures, counts, worker


def show(worker, paths, structure, seed, method, rtol):
    """Print the events of a run beside those of the reference."""
    values, has_ties = random_values(structure, seed)
    reference = make_reference(structure, seed)
    expected = reference.expected.get(rtol)
    print(write_model(structure))
    print(values, "tied" if has_ties else "")
    print("compared until", expected and expected.until, expected and expected.reason, reference.failure)
    names = names_of(structure)
    fmu = worker.instantiate(paths[structure.seed, "native"])
    fmu.begin({**values, "solver.method": method, "solver.rtol": rtol}, stop=STOP)
    t, row = 0.0, fmu.get(*names)
    n = len(structure.contacts)
    lines = [(0.0, "fmu", row[:n], "")]
    try:
        while t < STOP:
            ahead = fmu.get("solver.t_next")
            ahead = STOP if isnan(ahead) or ahead > STOP else ahead
            fmu.step(t, ahead - t)
            t, before, row = ahead, row, fmu.get(*names)
            if row[n] != before[n]:
                lines.append(
                    (row[n + 1], "fmu", row[:n], f"{row[n]} v {row[n + 2 + structure.n : n + 2 + 2 * structure.n]}")
                )
    except FmiError:
        lines.append((t, "fmu", [text for status, _, text in fmu.messages() if status], ""))
    lines += [(0.0, "reference", reference.first_modes, "")]
    lines += [(t, "reference", modes, k + 1) for k, (t, modes) in enumerate(reference.events)]
    lines += [(t, kind, contact, f"{margin:.1e}") for t, kind, contact, margin in reference.decisions]
    for line in sorted(lines, key=lambda item: item[0]):
        print(f"{line[0]:.12f} {line[1]:10} {line[2]} {line[3]}")
    fmu.free()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--structures", type=int, default=20, help="number of model files")
    parser.add_argument("--values", type=int, default=25, help="number of parameter sets for each")
    parser.add_argument("--first", type=int, default=0, help="seed of the first model file")
    parser.add_argument("--first-values", type=int, default=0, help="seed of the first parameter set")
    parser.add_argument("--folder", type=Path, default=Path("/tmp/random-campaign"), help="for FMUs and references")
    parser.add_argument("--solutions", type=Path, help="folder for solutions; by default that of the FMUs")
    parser.add_argument("--root", type=Path, default=ROOT, help="sources that build the FMUs")
    parser.add_argument("--bits", type=int, default=5, help="compare the backends in every n-th case")
    parser.add_argument("--show", type=int, nargs=2, metavar=("STRUCTURE", "VALUES"), help="print the events of a run")
    parser.add_argument("--method", type=int, default=4, choices=METHODS)
    parser.add_argument("--rtol", type=float, default=1e-6)
    arguments = parser.parse_args()
    folder, solutions = arguments.folder, arguments.solutions or arguments.folder
    for path in (folder, solutions):
        path.mkdir(parents=True, exist_ok=True)
    build_cache.shared_folder = folder.resolve()  # for the temporary files of the worker
    worker = Worker()
    if arguments.show:
        structure = random_structure(arguments.show[0])
        paths, _ = build([structure], folder, ("native",), arguments.root)
        show(worker, paths, structure, arguments.show[1], arguments.method, arguments.rtol)
        worker.close()
        return
    counts, kinds, examples = Counter(), Counter(), {}
    for number in range(arguments.first, arguments.first + arguments.structures):
        structure = random_structure(number)
        paths, failures = build([structure], folder, root=arguments.root)
        for seed in range(arguments.first_values, arguments.first_values + arguments.values):
            reference = cached_reference(structure, seed, solutions)
            slow = ("python", "fmi3") if seed % arguments.bits == 0 else ()
            new_failures, new_counts, worker = run_case(worker, paths, structure, seed, reference, slow_backends=slow)
            failures += new_failures
            counts += new_counts
            counts["cases"] += 1
            counts["cases with failures"] += bool(new_failures)
        for failure in failures:
            print(failure, flush=True)
            kinds[failure.kind, METHODS.get(failure.method), failure.rtol] += 1
            examples.setdefault(failure.kind, (failure.structure, failure.values))
    print(*(f"{key}: {n}" for key, n in counts.items()), sep="\n")
    print(*(f"{key}: {n}" for key, n in sorted(kinds.items(), key=str)), sep="\n")
    print("examples", examples)
    worker.close()
    sys.exit(bool(kinds))


if __name__ == "__main__":
    main()
