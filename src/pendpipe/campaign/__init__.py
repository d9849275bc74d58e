"""A campaign as one measurement: all records' frequencies and losses from shared parameters."""
