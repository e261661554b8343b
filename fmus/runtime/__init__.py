"""What travels inside every FMU: standard library only, plain floats."""
