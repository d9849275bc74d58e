"""Simulated instruments that speak the real ones' bytes.

They share no code with the drivers: an error would else be made twice and seen by nobody.
"""
