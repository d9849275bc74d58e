"""Files of named arrays: HDF5, NumPy, JSON, TDMS, sound."""

from pendpipe.formats import trees
from pendpipe.formats.plugin import Dialect

HDF5 = Dialect(
    "file of arrays",
    lambda head: b"\x89HDF\r\n\x1a\n" in head[:1024] or head[:10] == b"MATLAB 7.3",
    trees.read_hdf5,
)
NUMPY = Dialect(
    "file of arrays",
    lambda head: head[:6] == b"\x93NUMPY" or (head[:2] == b"PK" and b".npy" in head[:128]),
    trees.read_numpy,
)
TDMS = Dialect("file of arrays", lambda head: head[:4] == b"TDSm", trees.read_tdms)
SOUND = Dialect("sound", lambda h: h[:4] == b"RIFF" and h[8:12] == b"WAVE", trees.read_sound)
JSON = Dialect(
    "JSON", lambda h: h.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"{", b"["), trees.read_json
)
