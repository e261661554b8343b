"""The FMUs in hosts that need an environment of their own, compared with certified results."""
