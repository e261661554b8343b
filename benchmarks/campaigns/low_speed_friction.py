"""Which rise of friction at low speed a decay shows: `python -m benchmarks.campaigns.low_speed_friction [RECORDS]`.

RECORDS are simulated by scipy for each rise (friction at standstill over that at high speed), speed v_s (relative to
the first peak speed) and noise (relative to the first amplitude), with viscous damping or without.  The table gives the
records in which `decay` shows a departure in speed or in amplitude, how often the 95 % intervals of zeta and r hold,
and the records with any remark.  A rise of 1 is none.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

from harness import HarnessError, identify_decay

AMPLITUDE = 0.05  # m
DURATION, SAMPLES = 40.0, 1500  # periods
LAWS = ((0.003, 0.006), (0.0, 0.006))  # zeta, and r relative to the amplitude
RISES, SPEEDS, NOISES = (1.0, 1.2, 1.5, 2.0), (0.05, 0.2, 0.5), (1e-4, 1e-3, 5e-3)
CASES = [(rise, speed) for rise, speed in product(RISES, SPEEDS) if rise > 1 or speed == SPEEDS[0]]


@cache
def decay(zeta, r, rise, speed):
    """Return times (n,) and positions (n,) of a decay from the amplitude 1, with a frequency of 1 rad/s."""
    t = np.linspace(0.0, 2 * np.pi * DURATION, SAMPLES)
    x = np.empty_like(t)
    y, start, sign = 1.0, 0.0, -1.0
    while start < t[-1] and abs(y) > r * rise:

        def rates(_, u, sign=sign):
            friction = r * (1 + (rise - 1) * np.exp(-abs(u[1]) / speed))
            return [u[1], -u[0] - 2 * zeta * u[1] - sign * friction]

        def standstill(_, u):
            return u[1]

        standstill.terminal, standstill.direction = True, -sign
        inside = t >= start
        half = solve_ivp(
            rates,
            (start, start + 5.0),
            [y, 0.0],
            "DOP853",
            t[inside & (t < start + 5.0)],
            events=standstill,
            rtol=1e-9,
            atol=1e-12,
        )
        count = half.y.shape[1]
        first = int(np.argmax(inside))
        x[first : first + count] = half.y[0]
        start, y, sign = float(half.t_events[0][-1]), float(half.y_events[0][-1][0]), -sign
    x[t >= start] = y
    return t, x


def check_record(task):
    """Fit a record; return whether it shows a departure, which intervals hold, and whether there is a remark."""
    (rise, speed), noise, number = task
    zeta, r = LAWS[number % len(LAWS)]
    t, x = decay(zeta, r, rise, speed)
    x = AMPLITUDE * (x + noise * np.random.default_rng((number, int(1e6 * noise))).standard_normal(len(t)))
    try:
        fit = identify_decay((t / (2 * np.pi), x), unit="m", progress=False)
    except HarnessError:
        return None
    coverage = [fit[name].low <= value <= fit[name].high for name, value in (("zeta", zeta), ("r", AMPLITUDE * r))]
    text = " ".join(fit.remarks)
    return "in speed by" in text or "in amplitude by" in text, coverage, bool(text)


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 4
    print(f"{'rise':>4} {'speed':>5} {'noise':>6} {'fitted':>6} {'shown':>5} {'holds':>6} {'remark':>6}")
    with ProcessPoolExecutor(2) as pool:
        for case in CASES:
            for noise in NOISES:
                n = 5 * count if case[0] == 1 else count
                rows = [row for row in pool.map(check_record, [(case, noise, i) for i in range(n)]) if row]
                holds = np.mean([row[1] for row in rows])
                n_shown, remarks = (sum(row[i] for row in rows) for i in (0, 2))
                print(
                    f"{case[0]:4} {case[1]:5} {noise:6.0e} {len(rows):6} {n_shown:5} {holds:6.2f} {remarks:6}",
                    flush=True,
                )
