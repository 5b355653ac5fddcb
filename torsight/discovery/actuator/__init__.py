"""The actuator's side of discovery.

In: records (angles in degrees, temperatures in °C). Out: rows, rests, drivers, errors of the temperatures, and curves
and laws in the units of files.
"""
