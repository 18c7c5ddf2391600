"""What is judged and what it is judged by: records, samples, estimates, truth, each a type."""
