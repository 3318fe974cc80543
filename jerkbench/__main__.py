"""`python -m jerkbench` is `jerkbench`."""

from jerkbench.cli import main

if __name__ == "__main__":
    main()
