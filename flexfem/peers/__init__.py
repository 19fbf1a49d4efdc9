"""Other solvers on our meshes: what NGSolve and CalculiX make of the same triangles."""
