"""Whole simulations as WebAssembly: modules, plans, and the script that runs them."""
