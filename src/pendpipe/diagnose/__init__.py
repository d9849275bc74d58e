"""Where a model and a recording differ, and what was left out."""
