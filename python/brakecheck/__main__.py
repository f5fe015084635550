"""`python -m brakecheck` is the command line."""

from brakecheck._cli import main

main()
