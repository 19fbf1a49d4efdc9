"""One page on a mechanism file that answers while its numbers are changed."""
