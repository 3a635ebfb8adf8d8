"""`python -m clothsim` is the command `clothsim`."""

import sys

from clothsim.cli import main

if __name__ == "__main__":
    sys.exit(main())
