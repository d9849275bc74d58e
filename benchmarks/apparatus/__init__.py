"""A second generator of recordings with concealed effects, made as apparatus makes them.

    python -m benchmarks.apparatus --set trial --number 60 [--list] [--journal FILE]

Encoders, cameras and converters, torsion wheels and pendulums that swing up to 2.6 rad with sin x,
laws of the catalogue, laws out of it, faults of sensors and clocks. It was written from the laws,
the file format and recordings of real apparatus, without a look at the diagnosis or at the
challenge's generator, and shares no code with the library. Changes after the diagnosis has met a
set are corrections of errors, and are listed here:

* a reading between a turn and the next point of the grid had the turning point before, so that play
  in a sensor's coupling made single wrong readings (seen in the set `trial2`).
"""
