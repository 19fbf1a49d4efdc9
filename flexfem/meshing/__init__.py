"""gmsh in processes of its own: triangles, contours and solids of plates."""
