"""What runs and records say: decay, slip, steps."""
