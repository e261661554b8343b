"""The same scenes with dry friction in other engines, each with its default and with its best setting.

scenes.py defines the scenes and the results of a rival, engines/ has one file for each engine, catalogue.py has their
settings, and child.py runs an engine in a separate process.
"""
