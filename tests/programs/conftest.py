"""The programs are run by tests/test_programs.py; importing them as doctests would warn of their old addresses."""

collect_ignore_glob = ["*.py"]
