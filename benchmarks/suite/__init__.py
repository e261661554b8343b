"""The friction suite: hard cases with certified results, for developers of tools that import FMUs.

cases.py defines the cases, writer.py writes them to a folder, with check.py, which judges the results of a tool and
needs numpy only, and importers.py runs them in the tools that are installed.
"""
