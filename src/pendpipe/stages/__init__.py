"""A campaign's stages: each reads files, calls the library and writes files."""
