"""JSON schemas (draft 7) of the files that flexfem reads and writes, and tables of their keys."""
