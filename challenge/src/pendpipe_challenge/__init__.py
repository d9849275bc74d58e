"""Concealed effects: an independent generator, its oracle, sealing and scoring.

Of the library it imports what says nothing about pendulums: the proof may not be the program
agreeing with itself.

The generator: `torques`, `motion`, `chain`, `scenario`; what it hides: `hidden` and
`hidden_...`, `catalogue`. The oracle: `bench`, `signatures`, `oracle`, `sizing`. A set: `items`,
`recordings`, `sets`. Its scores: `answers`, `intervals`, `measures`, `peers`, `score`, `figures`,
`page`.
"""
