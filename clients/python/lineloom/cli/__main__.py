"""`python -m lineloom.cli` is `lineloom`."""

from lineloom.cli.app import main

main()
