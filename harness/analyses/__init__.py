"""Analyses of runs and records: decay, stick-slip and step sizes."""
