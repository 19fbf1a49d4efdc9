"""One self-contained HTML page of a stage, of stored results or of a study."""
