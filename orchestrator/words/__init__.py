"""How numbers, shares and lists are written for people, everywhere alike."""
