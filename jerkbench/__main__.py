"""The command line as `python -m jerkbench`."""

from jerkbench.cli import main

if __name__ == "__main__":
    main()
