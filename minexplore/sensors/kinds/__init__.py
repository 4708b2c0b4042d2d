"""One sensor a file; every module here is read, and nothing else lists them."""
