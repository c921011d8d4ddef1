"""``python -m paramreduce_cli``"""

from paramreduce_cli.cli import main

if __name__ == "__main__":
    main()
