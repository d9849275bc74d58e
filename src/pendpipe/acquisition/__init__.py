"""What the instrument's bytes mean, and how they are kept.

`drivers` decode and `devices` encode; neither imports the other. `recorder.record` keeps
the bytes first and decodes them afterwards, `recorder.acquire_simulated` does the same
with a simulated device on a line of its own. `decode` finds the raw files of a record apart.
"""
