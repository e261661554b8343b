"""Runtime that every FMU carries: solver, friction, and FMI instance; standard library only, plain floats."""
