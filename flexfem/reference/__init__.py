"""What every file may say: JSON schemas and reference pages, made from the models that read the files."""
