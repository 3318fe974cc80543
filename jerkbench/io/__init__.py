"""Files: what a recording, a trajectory or a trace is read from and written to. No plugin.

The way of a table: `text` and `columns` read it, `frames` turns it into ENU and the body's axes, `table` and
`table_values` make its streams. The way of a bag is told in `ros`. `sanitiser` finds what is wrong in either.
"""
