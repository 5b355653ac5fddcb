"""The actuator's side of discovery.

Records (angles in degrees, temperatures in °C) in; drivers, errors of the temperatures, curves and laws for people out.
"""
