"""Coupled FMUs: written as an SSP archive, run by existing engines, compared with a monolithic model."""
