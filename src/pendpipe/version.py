"""The version of this installation, of the tag that it was built from; it imports nothing heavy."""

try:
    # Written by the build (setuptools-scm), and kept out of the repository.
    from pendpipe._version import version
except ImportError:
    import importlib.metadata

    version = importlib.metadata.version("pendpipe")

__version__: str = version
