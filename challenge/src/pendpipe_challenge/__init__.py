"""Concealed effects: an independent generator, its oracle, sealing and scoring.

Of the library it imports what says nothing about pendulums: the proof may not be the program
agreeing with itself.

How a pendulum moves: `torques`, `motion`. What stands on the bench, and what a change of it is
worth: `world`. What can be hidden: `causes`. The `oracle`. A set: `items`, `sets`. Its `score`.
"""
