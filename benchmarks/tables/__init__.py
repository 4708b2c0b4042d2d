"""Tables of the docs that are made from the code, and their place on the pages."""
