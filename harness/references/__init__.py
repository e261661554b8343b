"""The reference motions, and the script that makes them: python -m harness.references"""
