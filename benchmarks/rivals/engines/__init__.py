"""One file for each engine, of at most 60 lines, with the function simulate(scene, setting) -> Solution.

A file is written as by a user of the engine; the table counts its lines of code.  The harness imports it in a child
process, so that an engine may be missing, crash or hang.
"""
