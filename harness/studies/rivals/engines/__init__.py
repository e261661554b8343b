"""One file for each engine, of at most 60 lines, with the function simulate(scene, setting) -> Solution.

A file reads as a user of the engine writes it: the lines of code in the table are counted in it.  The harness imports
it in a child process, so that an engine may be missing, crash or hang.
"""
