"""From a file of declared equations to a model in plain scalars.

    expressions.py   what can be calculated with
    declared.py      the variables of a model, and what says how they hang together
    authored.py      the file of an author: where it is, what it holds, what is wrong with it and in which line
    algebra.py       values put in, derivatives, operations undone, bounds
    anatomy.py       roles by name: states and their rates, drives, contacts with their loads; what can be run
    dimensions.py    units of expressions against those declared
    names.py         those that a written-out model takes for itself
    scribe.py        expressions as text, line by line
    frame.py         what its methods share
    values.py, motion.py, friction.py, coupled.py, outputs.py    its methods
    written.py       its text

Nothing is regrouped: what an author wrote as (F_ext + F_spring - F_friction) / m is calculated in that order.
"""
