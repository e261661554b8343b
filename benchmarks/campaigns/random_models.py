"""Random models with dry friction: a structure is a model file, a case is a set of values for it.

The same structure and values give the text of a model file and a system for independent_contacts.py.
"""

import random
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from benchmarks.campaigns.independent_contacts import Contact, Spring, System

STOP = 4.0  # s
GROUND, DRIVER = -1, -2  # ends of springs that are not bodies


@dataclass(frozen=True)
class ContactShape:
    """Which terms a contact has; `row` holds the coefficients of the speeds in its slip."""

    row: tuple[int, ...]
    belt: bool
    belt_moves: bool
    curve: bool
    hold: bool  # an own holding limit, instead of the sliding force at zero slip
    load_1: bool
    load_t: bool
    load_q: int  # body on whose position the load depends, or -1
    is_limited: bool


@dataclass(frozen=True)
class Structure:
    """Which bodies, springs, forces and contacts a model has."""

    seed: int
    n: int
    springs: tuple[tuple[int, int, bool, bool], ...]  # body, other end, cubic term, damper
    force_0: tuple[bool, ...]
    force_1: tuple[bool, ...]
    contacts: tuple[ContactShape, ...]
    angle_starts: bool  # the phase at the start is that of the state, not a term of its own

    @property
    def name(self):
        return f"random{self.seed}"

    @property
    def has_angle(self):
        return any(self.force_1) or any(c.load_1 or c.belt_moves for c in self.contacts)

    @property
    def has_driver(self):
        return any(other == DRIVER for _, other, _, _ in self.springs)

    @property
    def rests_when_stuck(self):
        """Whether the only body rests while the only contact sticks, under a load that is linear in time.

        Such a contact has events at reversals without friction too.
        """
        c = self.contacts[0]
        return self.n == 1 and not (c.belt or c.load_1 or c.load_t or c.is_limited or self.force_1[0])

    @property
    def has_clock(self):
        return any(c.load_t for c in self.contacts)


def random_structure(seed):
    """Return a structure with 1 to 3 bodies and 1 to 3 contacts that do not hold the same motion twice."""
    rng = random.Random(f"structure {seed}")
    n = rng.choice([1, 1, 2, 2, 2, 3, 3])
    springs = []
    for i in range(n):
        other = rng.choice([GROUND, DRIVER]) if i == 0 else rng.choice([i - 1, i - 1, GROUND])
        springs.append((i, other, rng.random() < 0.25, rng.random() < 0.5))
    if n > 1 and rng.random() < 0.4:
        springs.append((n - 1, rng.choice([GROUND, DRIVER]), False, rng.random() < 0.5))
    rows = []
    for _ in range(rng.randint(1, n)):
        for _ in range(20):
            row = random_row(rng, n)
            if np.linalg.matrix_rank(np.array([*rows, row])) == len(rows) + 1:
                rows.append(row)
                break
    contacts = []
    for row in rows:
        belt = rng.random() < 0.35
        load_1, load_t = rng.random() < 0.3, rng.random() < 0.15
        load_q = rng.randrange(n) if rng.random() < 0.15 else -1
        is_limited = (load_1 or load_t or load_q >= 0) and rng.random() < 0.6
        contacts.append(
            ContactShape(
                tuple(row),
                belt,
                belt and rng.random() < 0.3,
                rng.random() < 0.4,
                rng.random() < 0.75,
                load_1,
                load_t,
                load_q if is_limited else -1,
                is_limited,
            )
        )
    return Structure(
        seed,
        n,
        tuple(springs),
        tuple(rng.random() < 0.4 for _ in range(n)),
        tuple(rng.random() < 0.4 for _ in range(n)),
        tuple(contacts),
        rng.random() < 0.1,
    )


def random_row(rng, n):
    """Return the coefficients of a slip: one speed, a difference of two, or one with a transmission."""
    row, i = [0] * n, rng.randrange(n)
    row[i] = 1
    if n > 1 and rng.random() < 0.45:
        j = rng.choice([j for j in range(n) if j != i])
        row[j] = rng.choice([-1, -1, -1, -2, 1])
    return row


# ---- the model file


def write_model(structure):
    """Return the text of the model file of a structure."""
    s, lines, functions = structure, [], {"Contact", "Fixed", "Mode", "Model", "Output", "Parameter", "State"}
    add = lines.append

    def parameter(name, unit, text, kind="Parameter", start=1.0, limits=""):
        add(f'{name} = {kind}({start}, "{unit}", "{text}"{limits})')

    for i in range(s.n):
        parameter(f"m{i}", "kg", f"mass {i}", limits=", above=0.0")
        parameter(f"x{i}_0", "m", f"start of body {i}", "Fixed", 0.0)
        parameter(f"v{i}_0", "m/s", f"speed at the start of body {i}", "Fixed", 0.0)
    for n, (_, _, cubic, damper) in enumerate(s.springs):
        parameter(f"k{n}", "N/m", f"stiffness {n}", start=100.0, limits=", low=0.0")
        if cubic:
            parameter(f"h{n}", "N/m3", f"cubic stiffness {n}", limits=", low=0.0")
        if damper:
            parameter(f"c{n}", "N.s/m", f"damping {n}", limits=", low=0.0")
    for i in range(s.n):
        if s.force_0[i]:
            parameter(f"p{i}", "N", f"constant force on body {i}")
        if s.force_1[i]:
            parameter(f"a{i}", "N", f"amplitude of the force on body {i}")
    if s.has_angle:
        parameter("Omega", "rad/s", "angular frequency")
        parameter("angle_0", "rad", "angle at the start", "Fixed", 0.0)
    if s.has_driver:
        parameter("v_driver", "m/s", "speed of the driver", start=0.1)
    for n, c in enumerate(s.contacts):
        parameter(f"load{n}_0", "N", f"mean load {n}", start=10.0)
        parameter(f"mu{n}_d", "1", f"sliding friction {n}", start=0.25, limits=", low=0.0")
        if c.curve:
            parameter(f"mu{n}_p", "1", f"sliding friction {n} at zero slip", start=0.25, limits=", low=0.0")
            parameter(f"v_s{n}", "m/s", f"slip scale {n}", start=0.1, limits=", above=0.0")
        if c.hold:
            parameter(f"mu{n}_s", "1", f"static friction {n}", start=0.5, limits=", low=0.0")
        if c.belt:
            parameter(f"belt{n}_0", "m/s", f"speed of belt {n}", start=0.1)
        if c.belt_moves:
            parameter(f"belt{n}_1", "m/s", f"amplitude of the speed of belt {n}", start=0.0)
        if c.load_1:
            parameter(f"load{n}_1", "N", f"amplitude of load {n}", start=0.0)
        if c.load_t:
            parameter(f"load{n}_t", "N/s", f"rate of load {n}", start=0.0)
        if c.load_q >= 0:
            parameter(f"load{n}_q", "N/m", f"load {n} per displacement", start=0.0)
    for i in range(s.n):
        add(f'x{i} = State("m", "position {i}", start=x{i}_0)')
        add(f'v{i} = State("m/s", "speed {i}", start=v{i}_0, rate_of=x{i})')
    if s.has_angle:
        start = "start=angle_0, " * s.angle_starts
        add(f'angle = State("rad", "phase angle", {start}rate=Omega)')
        functions.add("sin")
        add(f"swing = sin(angle{'' if s.angle_starts else ' + angle_0'})")
    if s.has_driver:
        add('x_driver = State("m", "position of the driver", rate=v_driver)')
    if s.has_clock:
        add('clock = State("s", "time since the start", rate=1.0)')
    forces = [[] for _ in range(s.n)]
    for n, (i, other, cubic, damper) in enumerate(s.springs):
        end = {GROUND: "", DRIVER: " - x_driver"}.get(other, f" - x{other}")
        rate = {GROUND: "", DRIVER: " - v_driver"}.get(other, f" - v{other}")
        add(f"e{n} = x{i}{end}")
        law = f"k{n} * e{n}" + (f" + h{n} * e{n} * e{n} * e{n}" if cubic else "")
        law += f" + c{n} * (v{i}{rate})" if damper else ""
        add(f'F_spring{n} = Output("N", "force of spring {n}", {law})')
        forces[i].append(f"- F_spring{n}")
        if other >= 0:
            forces[other].append(f"+ F_spring{n}")
    for i in range(s.n):
        forces[i] += [f"+ p{i}"] * s.force_0[i] + [f"+ a{i} * swing"] * s.force_1[i]
    for n, c in enumerate(s.contacts):
        load = f"load{n}_0" + f" + load{n}_1 * swing" * c.load_1 + f" + load{n}_t * clock" * c.load_t
        load += f" + load{n}_q * x{c.load_q}" if c.load_q >= 0 else ""
        add(f"weight{n} = {load}")
        if c.is_limited:
            functions.add("choose")
            add(f"pressed{n} = choose(weight{n} > 0.0, weight{n}, 0.0)")
        normal = f"pressed{n}" if c.is_limited else f"weight{n}"
        slip = " ".join(
            f"{'+' if g > 0 else '-'} {f'{abs(g)}.0 * ' if abs(g) > 1 else ''}v{i}" for i, g in enumerate(c.row) if g
        ).removeprefix("+ ")
        slip += f" - belt{n}_0" * c.belt + f" - belt{n}_1 * swing" * c.belt_moves
        add(f"slip{n} = {slip}")
        friction = f"mu{n}_d"
        if c.curve:
            functions.add("exp")
            add(f"ratio{n} = slip{n} / v_s{n}")
            friction = f"(mu{n}_d + (mu{n}_p - mu{n}_d) * exp(-ratio{n} * ratio{n}))"
        hold = f", hold=mu{n}_s * {normal}" if c.hold else ""
        add(f"mode{n} = Mode()")
        add(f'F{n} = Contact("N", "friction {n}", mode=mode{n}, slip=slip{n}, slide={friction} * {normal}{hold})')
        for i, g in enumerate(c.row):
            if g:
                forces[i].append(f"{'-' if g > 0 else '+'} {f'{abs(g)}.0 * ' if abs(g) > 1 else ''}F{n}")
    for i in range(s.n):
        law = " ".join(forces[i]).removeprefix("+ ")
        add(f'acc{i} = Output("m/s2", "acceleration {i}", ({law}) / m{i}, rate_of=v{i})')
    add(f"stop_time = {STOP}")
    body = "\n".join(f"    {line}" for line in lines)
    return (
        f"from fmus import {', '.join(sorted(functions))}\n\n\n"
        f'class {s.name.capitalize()}(Model):\n    """Random model {s.seed}."""\n\n{body}\n'
    )


# ---- values


def random_values(structure, seed):
    """Return values of all parameters of a structure, as in the model file.

    Two of five sets have ties: round values, equal for all bodies, starts at rest or exactly at the holding limit.
    """
    s, rng = structure, random.Random(f"values {structure.seed} {seed}")
    has_ties = rng.random() < 0.4

    def pick(low, high, *round_values):
        if has_ties:
            return rng.choice(round_values)
        return low * (high / low) ** rng.random()

    values = {}
    mass, stiffness = pick(0.5, 4.0, 1.0, 2.0), pick(20.0, 400.0, 32.0, 128.0)
    for i in range(s.n):
        values[f"m{i}"] = mass if has_ties else pick(0.5, 4.0)
        at_rest = rng.random() < (0.8 if has_ties else 0.3)
        values[f"x{i}_0"] = rng.choice([0.0, 0.0, 0.125, 0.25, -0.25]) if has_ties else rng.uniform(-0.3, 0.3)
        values[f"v{i}_0"] = 0.0 if at_rest else rng.choice([-1, 1]) * pick(0.02, 1.0, 0.25, 0.5)
    for n, (_, _, cubic, damper) in enumerate(s.springs):
        values[f"k{n}"] = stiffness if has_ties else pick(20.0, 400.0)
        if cubic:
            values[f"h{n}"] = pick(10.0, 2000.0, 0.0, 512.0)
        if damper:
            values[f"c{n}"] = rng.choice([0.0, 1.0]) if has_ties else pick(0.05, 5.0)
    load, force = pick(4.0, 40.0, 8.0, 16.0), pick(0.5, 20.0, 2.0, 4.0)
    for i in range(s.n):
        if s.force_0[i]:
            values[f"p{i}"] = force if has_ties else rng.choice([-1, 1]) * pick(0.2, 15.0)
        if s.force_1[i]:
            values[f"a{i}"] = rng.choice([force, 2.0 * force, 4.0 * force]) if has_ties else pick(0.5, 30.0)
    if s.has_angle:
        values["Omega"] = pick(1.5, 25.0, 4.0, 8.0)
        values["angle_0"] = 0.0 if has_ties else rng.uniform(0.0, 2.0 * pi)
    if s.has_driver:
        values["v_driver"] = rng.choice([-1, 1]) * pick(0.05, 0.6, 0.125, 0.25)
    level = pick(0.1, 0.5, 0.25, 0.5)
    for n, c in enumerate(s.contacts):
        values[f"load{n}_0"] = load if has_ties else pick(4.0, 40.0)
        free = rng.random() < 0.08
        mu_d = 0.0 if free else level if has_ties else pick(0.05, 0.6)
        peak = mu_d * (rng.choice([1.0, 1.02, 1.25, 1.5, 2.0]) if c.curve else 1.0)
        values[f"mu{n}_d"] = mu_d
        if c.curve:
            values[f"mu{n}_p"] = peak
            values[f"v_s{n}"] = pick(0.03, 0.5, 0.125)
        if c.hold:
            values[f"mu{n}_s"] = peak * rng.choice([1.0, 1.001, 1.01, 1.05, 1.25, 1.5, 2.0])
        if c.belt:
            values[f"belt{n}_0"] = 0.0 if rng.random() < 0.1 else rng.choice([-1, 1]) * pick(0.03, 0.5, 0.125, 0.25)
        if c.belt_moves:
            values[f"belt{n}_1"] = pick(0.01, 0.4, 0.0, 0.125)
        share = rng.choice([0.3, 0.8, 1.2, 1.6]) if c.is_limited else rng.choice([0.3, 0.6, 0.9])
        if c.load_1:
            values[f"load{n}_1"] = values[f"load{n}_0"] * share
        if c.load_t:
            slope = rng.uniform(-0.4, 0.5) if c.is_limited else rng.uniform(0.02, 0.3)
            values[f"load{n}_t"] = slope * values[f"load{n}_0"]
        if c.load_q >= 0:
            values[f"load{n}_q"] = rng.choice([-1, 1]) * values[f"load{n}_0"] * rng.choice([0.5, 2.0, 4.0])
    if has_ties and rng.random() < 0.5:
        start_at_limit(s, values)
    return values, has_ties


def start_at_limit(structure, values):
    """Set the constant force of bodies that rest on the ground to the holding limit of their contact."""
    for n, c in enumerate(structure.contacts):
        bodies = [i for i, g in enumerate(c.row) if g]
        if len(bodies) == 1 and structure.force_0[bodies[0]] and not (c.belt or c.load_q >= 0):
            i = bodies[0]
            hold = values.get(f"mu{n}_s", values.get(f"mu{n}_p", values[f"mu{n}_d"]))
            values[f"p{i}"] = hold * values[f"load{n}_0"]
            values[f"v{i}_0"] = values[f"x{i}_0"] = 0.0


def to_system(structure, values):
    """Return the same model as a system of independent_contacts.py."""
    s = structure

    def get(name):
        return values.get(name, 0.0)

    springs = []
    for n, (i, other, _, _) in enumerate(s.springs):
        row = [0.0] * s.n
        row[i] = 1.0
        if other >= 0:
            row[other] = -1.0
        springs.append(Spring(tuple(row), get(f"k{n}"), get(f"h{n}"), get(f"c{n}"), float(other == DRIVER)))
    contacts = []
    for n, c in enumerate(s.contacts):
        peak = values.get(f"mu{n}_p", values[f"mu{n}_d"])
        load_q = [0.0] * s.n
        if c.load_q >= 0:
            load_q[c.load_q] = get(f"load{n}_q")
        contacts.append(
            Contact(
                tuple(map(float, c.row)),
                values[f"mu{n}_d"],
                peak,
                values.get(f"mu{n}_s", peak),
                values[f"load{n}_0"],
                get(f"load{n}_1"),
                get(f"load{n}_t"),
                tuple(load_q),
                c.is_limited,
                values.get(f"v_s{n}", 1.0),
                get(f"belt{n}_0"),
                get(f"belt{n}_1"),
            )
        )
    return System(
        tuple(values[f"m{i}"] for i in range(s.n)),
        tuple(springs),
        tuple(contacts),
        tuple(get(f"p{i}") for i in range(s.n)),
        tuple(get(f"a{i}") for i in range(s.n)),
        tuple(values[f"x{i}_0"] for i in range(s.n)),
        tuple(values[f"v{i}_0"] for i in range(s.n)),
        get("Omega") if s.has_angle else 1.0,
        get("angle_0"),
        get("v_driver"),
        STOP,
        s.rests_when_stuck,
    )


def perturb(system, share, seed, has_ties):
    """Return a system whose values differ by `share`; with ties, only by common factors that keep the ties."""
    rng = random.Random(f"perturbation {seed}")

    def factor():
        return 1.0 + share * rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 1.0)

    mass, damping = factor(), factor()
    if has_ties:
        return replace(
            system,
            masses=tuple(m * mass for m in system.masses),
            springs=tuple(replace(s, c=s.c * damping) for s in system.springs),
            omega=system.omega * factor(),
        )
    return replace(
        system,
        masses=tuple(m * factor() for m in system.masses),
        springs=tuple(replace(s, k=s.k * factor(), c=s.c * factor()) for s in system.springs),
        contacts=tuple(replace(c, load_0=c.load_0 * factor(), belt=c.belt * factor()) for c in system.contacts),
        force_0=tuple(f * factor() for f in system.force_0),
        force_1=tuple(f * factor() for f in system.force_1),
        q_0=tuple(q * factor() for q in system.q_0),
        v_0=tuple(v * factor() for v in system.v_0),
        omega=system.omega * factor(),
        v_driver=system.v_driver * factor(),
    )
