"""The same scenes with dry friction in other engines, each at its defaults and at its best setting.

scenes.py defines the scenes and what a rival returns, engines/ has one file for each engine, catalogue.py their
settings, and child.py runs one of them in a process of its own.
"""
