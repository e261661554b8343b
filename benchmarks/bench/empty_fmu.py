"""An empty FMU with the variables of another one, to measure the overhead of a communication step.

It is built by plain pythonfmu as in its documentation, without code of this project.
"""

from pathlib import Path

from pythonfmu.builder import FmuBuilder

SCRIPT = """\
from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


class Thing:
    pass


class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(start_time=0.0, stop_time={stop!r})
        for kind, name, causality, variability in {variables!r}:
            owner, *path = self, *name.split(".")
            for part in path[:-1]:
                owner.__dict__.setdefault(part, Thing())
                owner = getattr(owner, part)
            setattr(owner, path[-1], 0.0 if kind == "Real" else 0)
            traits = {{"causality": Fmi2Causality[causality], "variability": Fmi2Variability[variability]}}
            self.register_variable({{"Real": Real, "Integer": Integer}}[kind](name, **traits))

    def do_step(self, current_time, step_size):
        return True
"""


def build_empty_fmu(name: str, variables: list[tuple[str, str, str, str]], stop: float, folder: Path) -> Path:
    """Build <name>.fmu with variables (Real or Integer, name, causality, variability); return its path."""
    script = folder / f"{name.lower()}.py"
    script.write_text(SCRIPT.format(name=name, stop=stop, variables=variables), encoding="utf-8")
    return Path(FmuBuilder.build_FMU(script, dest=folder))
