"""What a run means: values, units and frames, shared by the logger and the desktop programs.

Conventions, written once:

- `_dbm` power level, `_db` ratio, `_m` metres, `_deg` degrees, `_s` seconds, `_ns` integer
  nanoseconds, `_mps` metres per second.
- `t_ns` is time since boot (CLOCK_BOOTTIME), the only time that orders anything; `utc_ns` is
  nanoseconds since 1970-01-01 UTC by GPS.
- `x_m, y_m` are east and north in the UTM zone of the run; `lat_deg, lon_deg` are WGS 84.
- azimuths are clockwise from grid north.
- The state of every filter is [x, y, P0, eta]: level = P0 - 10 eta log10(d), P0 in dBm at 1 m.
- Unknown is None in a value, NaN in a float array, and the column's own mark in an integer array
  (see `schema`); never 0 and never 255.
"""
