"""``python -m sblcosim`` is the command ``sblcosim``."""

from .cli import main

if __name__ == "__main__":
    main()
