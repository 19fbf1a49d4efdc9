"""The part for the workshop: .dxf and .svg drawings of lines and arcs in mm, and a .step solid."""
