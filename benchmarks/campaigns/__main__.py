"""Run all campaigns, or those named, one after another, and print a table: `python -m benchmarks.campaigns [NAME ...]`.

The output of each campaign goes to results/campaigns/NAME.txt. A campaign fails if its exit status is not zero: tests
that fail, and records, fits or motions that are wrong without a remark. The exit status is 1 if a campaign fails.
"""

import resource
import subprocess
import sys
from pathlib import Path

CAMPAIGNS = {  # name -> command, after the path of Python
    "tests": ("-m", "pytest", "-q", "-m", "campaign"),
    "random_campaign": ("-m", "benchmarks.campaigns.random_campaign", "--structures", "20", "--values", "25"),
    "planar_contacts": ("-m", "benchmarks.campaigns.planar_contacts", "--scenes", "1000", "--driven", "200"),
    "fit_campaign": ("-m", "benchmarks.campaigns.fit_campaign", "--seed", "58", "--records", "200"),
    "interval_coverage": ("-m", "benchmarks.campaigns.interval_coverage", "100"),
    "decay_defects": ("-m", "benchmarks.campaigns.decay_defects", "200", "4813"),
    "low_speed_friction": ("-m", "benchmarks.campaigns.low_speed_friction", "4"),
    "curve_coverage": ("-m", "benchmarks.campaigns.curve_coverage", "900"),
    "hidden_defects": ("-m", "benchmarks.campaigns.hidden_defects", "200"),
    "orbit_campaign": ("-m", "benchmarks.campaigns.orbit_campaign", "200", "64"),
    "decay_times": ("-m", "benchmarks.campaigns.decay_times"),
}
FOLDER = Path("results/campaigns")


def processor_time() -> float:
    """Return the processor time in s of all child processes that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def run_campaign(name: str) -> tuple[int, float, str]:
    """Run a campaign; return its exit status, its processor time in s, and the last line of its output."""
    start = processor_time()
    with (FOLDER / f"{name}.txt").open("w+", encoding="utf-8") as output:
        process = subprocess.run([sys.executable, *CAMPAIGNS[name]], stdout=output, stderr=subprocess.STDOUT)
        output.seek(0)
        lines = output.read().split("\n")
    return process.returncode, processor_time() - start, next(filter(None, map(str.strip, reversed(lines))), "")


def main(names: list[str]) -> int:
    """Run the campaigns of these names, or all; return the exit status."""
    if unknown_names := [name for name in names if name not in CAMPAIGNS]:
        print(f"Error: there is no campaign {unknown_names[0]!r}; choose from {', '.join(CAMPAIGNS)}", file=sys.stderr)
        return 2
    FOLDER.mkdir(parents=True, exist_ok=True)
    print(f"{'campaign':20} {'status':>6} {'CPU':>8}  last line", flush=True)
    statuses = []
    for name in names or CAMPAIGNS:
        status, seconds, last_line = run_campaign(name)
        statuses.append(status)
        print(f"{name:20} {'passed' if status == 0 else 'FAILED':>6} {seconds:6.0f} s  {last_line}", flush=True)
    return int(any(statuses))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
