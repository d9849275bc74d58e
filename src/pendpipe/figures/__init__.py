"""The figures of a campaign: 3 to 10 of the paper, the tail trap, and each record's decay.

Each module holds one figure as a pure function from data to a matplotlib ``Figure``;
`pendpipe.figures.campaign` reads the files, draws and saves them all.
"""
