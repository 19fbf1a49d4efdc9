"""From requirements to dimensions: the search for a stage, its correction by finite elements, and what it found."""
