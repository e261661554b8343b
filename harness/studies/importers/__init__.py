"""The built FMUs in tools that others wrote: each tool in a process of its own, its answers beside fmpy's.

A request names instances, values, connections and changes in mid-run (request.py); a player (by_*.py) carries it out
in one tool; checks.py says what is asked, table.py runs it all.
"""
