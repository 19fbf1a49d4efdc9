"""What the commands answer, asked from Python: every function gives the record that its command prints.

A command prints its record as a table or, with `--json`, field by field; `flexfem.plot` draws it. A module has the
functions of the commands in `flexfem.commands` under its name, and is loaded when one of them is asked for.
"""
