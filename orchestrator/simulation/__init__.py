"""Systems, plans, and the masters that execute them."""
