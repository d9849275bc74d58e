"""The page about a campaign: one self-contained HTML file, readable without a network.

`pendpipe.report.page.render` makes it from the stages' results; the other modules each
prepare one part of it. Nothing is computed here that a stage has not computed before.
"""
