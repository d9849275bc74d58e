"""Files of named arrays: HDF5, MATLAB, NumPy, JSON, TDMS, sound."""

from pendpipe.formats import trees
from pendpipe.formats.plugin import Dialect

HDF5 = Dialect("file of arrays", trees.is_hdf5, trees.read_hdf5)
NUMPY = Dialect("file of arrays", trees.is_numpy, trees.read_numpy)
TDMS = Dialect("file of arrays", lambda head: head[:4] == b"TDSm", trees.read_tdms)
SOUND = Dialect("sound", lambda h: h[:4] == b"RIFF" and h[8:12] == b"WAVE", trees.read_sound)
MATLAB = Dialect("file of arrays", trees.is_matlab, trees.read_matlab)
MATLAB_4 = Dialect("file of arrays", trees.is_matlab_4, trees.read_matlab_4)
JSON = Dialect("JSON", trees.is_json, trees.read_json)
