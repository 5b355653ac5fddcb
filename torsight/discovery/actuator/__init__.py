"""The actuator's side of discovery.

Records (angles in degrees, temperatures in °C) in; rows, rests, drivers, errors of the temperatures, curves and laws
for people out.
"""
