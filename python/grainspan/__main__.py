"""`python -m grainspan`: the program itself."""

from ._program import main

main()
