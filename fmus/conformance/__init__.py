"""The conformance kit: does an FMU for Co-Simulation, FMI 2 or 3, keep its promises?"""
