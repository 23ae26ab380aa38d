"""One module per engine; `python -m engines.NAME` measures it and prints its records."""
