"""Five oscillators with dry friction: one authored model a file."""
