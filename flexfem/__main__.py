"""`python -m flexfem`."""

import os
import sys

if sys.path[0] == os.getcwd():  # as `python -m` has it: a numpy.py lying there must not be ours
    sys.path.append(sys.path.pop(0))

from flexfem.commands.start import main

main()
