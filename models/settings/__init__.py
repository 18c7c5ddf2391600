"""What the keys of a scenario imply, as functions of numbers, CasADi symbols or expressions.

Each function takes tables of a complete scenario: objects whose attributes are keys, in the units
of a scenario file. A loaded scenario has such tables. A `types.SimpleNamespace` with a symbol in
place of a number is one too. Names, whole numbers and switches select branches, so they are never
symbols. Missing keys and components of other authors are handled by the scenario
(`sblcosim.scenario`).

``assumptions``
    What a receiver may assume of the system.
``beacons``
    Where the beacons are.
``either``
    Elementary functions of numbers, symbols or expressions.
``exact``
    Those that differ between libraries of C, of basic operations alone.
``expression``
    Numbers that remember how they are computed, and C code from them.
``keys``
    Units, bounds and starts: from keys to the parameters of the FMUs.
``motion``
    How the platform moves.
``names``
    Branches on names, in tables of expressions.
``packets``
    What packets hold, and how exactly.
``parameters``
    The parameters of a receiver's model, for bounds.
``paths``
    Number of points of a path.
``presets``
    Keys that set other keys: grades of sensors, the sea.
``start_values``
    The start values of all components, as expressions.
``times``
    Intervals.
"""
