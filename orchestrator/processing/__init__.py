"""Processing: recorded receptions and depths through receivers, and what is made of the result."""
