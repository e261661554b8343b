"""This process and those that it starts: signals, children, temporary folders."""
