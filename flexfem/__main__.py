"""`python -m flexfem`."""

from flexfem.cli import main

main()
