"""Drawings into mechanism files: contours are read, bodies and hinges found in the plate, and a
file written.
"""
