"""Entry point of `python -m jerkbench`, which runs the command line."""

from jerkbench.cli import main

if __name__ == "__main__":
    main()
