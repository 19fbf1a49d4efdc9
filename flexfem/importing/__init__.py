"""Drawings into mechanism files.

Contours are read, bodies and hinges are found in the plate, and a file is written."""
