"""FMUs as a program uses them: their functions, and instances of them."""
