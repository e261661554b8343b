"""Coupled FMUs: written as an SSP archive, run by existing engines, compared with one model of the whole system."""
