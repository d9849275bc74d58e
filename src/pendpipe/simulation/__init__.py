"""Recordings made from a described pendulum and measurement chain."""
