"""The command `mms`."""

import sys

from mmsmith import _mmsmith


def main() -> int:
    """Does what the command line asks for; gives the exit status."""
    return _mmsmith.main(["mms", *sys.argv[1:]])
