"""Console script `brakecheck`, with the whole command line of the extension."""

import signal
import sys

from brakecheck._brakecheck import run_program


def main() -> None:
    """Runs the command line on the process's arguments and exits with its code."""
    # Python would only note Ctrl-C and tell nobody before the program is done.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(run_program(["brakecheck", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
