"""What the keys of a scenario become, as functions of numbers or of CasADi's symbols.

A function takes tables of a complete scenario: any objects whose attributes are keys, in the units
of a scenario file. A loaded scenario has such tables; a `types.SimpleNamespace` with a symbol in
the place of a number is one, too. Names, whole numbers and switches are chosen with, so they are
never symbols. What is not given, and what belongs to a component of somebody else, is the
scenario's business (`sblcosim.scenario`).

``assumptions``
    What a receiver may assume of the system.
``beacons``
    Where the beacons are.
``either``
    Elementary functions of numbers or of symbols.
``keys``
    Units, bounds and starts: from keys to the parameters of the FMUs.
``packets``
    What packets say, and how exactly.
``parameters``
    The parameters of a receiver's model, for bounds.
``paths``
    How many points a path has.
``presets``
    Keys that set other keys: grades of sensors, the sea.
``times``
    Intervals.
"""
