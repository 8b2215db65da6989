# SPDX-License-Identifier: MIT
"""`python -m lodlab` is the command `lodlab`."""

from .cli.program import main

if __name__ == "__main__":
    main()
