"""``python -m torsight``: the command ``torsight``."""

from torsight.cli.main import main

if __name__ == "__main__":
    main()
