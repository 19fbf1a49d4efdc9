"""From requirements to dimensions: search, correction by finite elements, and the designed stage."""
