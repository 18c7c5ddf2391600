"""The data of judging, one type each: records, samples, estimates, truth."""
