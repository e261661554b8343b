"""The reference motions, made by python -m harness.truths."""
